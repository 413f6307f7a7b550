"""The YAML text of a script as values with their lines; only plain data is supported.

The text is composed into nodes and never constructed: no tag makes an object, nothing is executed.
Anchors are not supported either, so that a small text stays small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml
from yaml.reader import ReaderError

from katana450.errors import InputError
from katana450.extensions.programs.language.expression import PLAIN

MAX_BYTES = 64 * 1024
"""[bytes] Maximum size of a script."""

MAX_DEPTH = 16
"""Maximum nesting of values."""

MAX_VALUES = 10_000
"""Maximum number of YAML events of a text."""

NULL, TEXT = "tag:yaml.org,2002:null", "tag:yaml.org,2002:str"
WHOLE, REAL = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"


UNFINISHED = {
    "could not find expected ':'": "A colon and a blank are missing behind this name.",
    "expected ',' or ']'": "A comma or ] is missing in a list that begins with [. "
    "A text with brackets needs quotes.",
    "expected ',' or '}'": "A comma or } is missing in a mapping that begins with {. "
    "A text with brackets needs quotes.",
    "unexpected end of stream": "A quote has no end. Close it.",
}
"""Texts for errors of PyYAML that it notices behind their place, by a part of its text."""

MISPLACED = {
    r"'\t'": "A tab cannot stand here. Indent with blanks.",
    "that cannot start": "No value begins with this character. Put the text in quotes.",
    "mapping values are not": "A colon cannot stand here. Is one missing in the line before? A "
    "name begins in the column of its neighbours, and a text with a colon needs quotes.",
    "sequence entries are not": "A list cannot begin here. Put its `-` on a line of its own.",
    "<block end>, but found '}'": "This } closes nothing. Remove it.",
    "<block end>, but found ']'": "This ] closes nothing. Remove it.",
    "<block end>, but found '<scalar>'": "This stands behind the end of a value. Remove it, or put "
    "the whole text in quotes.",
    "expected <block end>": "This is indented differently from the lines before it. Begin all "
    "entries of a list, and all names of a mapping, in the same column.",
    "unknown escape": r"Write \\ for a backslash, or use single quotes.",
    "expected the node content": "A value is missing here.",
    "another document": "A second document begins here. Remove the line `---`.",
}
"""Texts for the others, the special ones first."""


@dataclass(frozen=True)
class Problem:
    """A problem at one place of the text; line and column count from 1."""

    line: int
    column: int
    text: str

    def __str__(self) -> str:
        return f"line {self.line}, column {self.column}: {self.text}"


class ScriptError(InputError):
    """A script that cannot be run, with all its problems in the order of their lines."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        self.problems = tuple(sorted(problems, key=lambda problem: (problem.line, problem.column)))
        super().__init__("\n".join(str(problem) for problem in self.problems))


@dataclass(frozen=True)
class YamlValue:
    """One value of the text.

    Attributes:
        line: line of its start, from 1.
        column: column of its start, from 1.
        held: a text, a list, or pairs of name and value; None for null.
        kind: ``text``, ``whole``, ``number``, ``list``, ``mapping``, ``nothing`` or ``other``.
        number: the number that the text stands for; None if it stands for none.
        unit: kind of quantity of the number, see ``expression.Quantity``.
        why: why a text is not an expression with a value; empty if that was not tried.
        last: last line of the text that it takes, from 1.
        end: column behind it, from 1; 0 for a list, a mapping, and a value of several lines.
    """

    line: int
    column: int
    held: str | tuple[YamlValue, ...] | tuple[tuple[YamlValue, YamlValue], ...] | None
    kind: str
    number: float | None = None
    unit: str = PLAIN
    why: str = ""
    last: int = 0
    end: int = 0

    @property
    def items(self) -> tuple[YamlValue, ...]:
        """The values of a list."""
        assert self.kind == "list"
        return self.held  # type: ignore[return-value]

    @property
    def fields(self) -> tuple[tuple[YamlValue, YamlValue], ...]:
        """The pairs of name and value of a mapping."""
        assert self.kind == "mapping"
        return self.held  # type: ignore[return-value]

    def wrong(self, problem: str) -> ScriptError:
        """Return the error ``problem`` for the place of this value."""
        return ScriptError((Problem(self.line, self.column, problem),))

    def __str__(self) -> str:
        return {"nothing": "nothing", "list": "a list", "mapping": "a mapping"}.get(
            self.kind, repr(self.held)
        )


def read(text: str, what: str = "script") -> YamlValue:
    """Return ``text`` as one value. Raises ScriptError with the place of an error.

    ``what`` names the text in messages.
    """
    if len(text.encode("utf-8", "replace")) > MAX_BYTES:
        raise ScriptError((Problem(1, 1, f"A {what} has at most {MAX_BYTES // 1024} KB."),))
    try:
        # The events are checked first: composing recurses, and resolves anchors.
        _check_bounds(text, what)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        raise ScriptError((Problem(*_explained(error, text)),)) from error
    if node is None:
        raise ScriptError((Problem(1, 1, f"The {what} is empty."),))
    return _value(node)


def _check_bounds(text: str, what: str) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=yaml.SafeLoader)):
        problem = ""
        if isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            depth += 1
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            depth -= 1
        if getattr(event, "anchor", None) is not None:
            problem = "Anchors and aliases (& and *) are not supported. Write the value in full."
        elif getattr(event, "tag", None) is not None:
            problem = f"Tags (!) are not supported: a {what} is plain data."
        elif depth > MAX_DEPTH:
            problem = f"This is more than {MAX_DEPTH} levels deep."
        elif count > MAX_VALUES:
            problem = f"A {what} holds at most {MAX_VALUES} values."
        if problem:
            raise ScriptError((Problem(*_place(event.start_mark), problem),))


def _place(mark: Any) -> tuple[int, int]:
    return mark.line + 1, mark.column + 1


def _value(node: yaml.Node) -> YamlValue:
    line, column = _place(node.start_mark)
    last = node.end_mark.line + 1
    # The mark of a value without brackets is behind the comments that follow it.
    if isinstance(node, yaml.MappingNode):
        fields = tuple((_value(key), _value(value)) for key, value in node.value)
        last = last if node.flow_style else fields[-1][1].last
        return YamlValue(line, column, fields, "mapping", last=last)
    if isinstance(node, yaml.SequenceNode):
        items = tuple(map(_value, node.value))
        last = last if node.flow_style else items[-1].last
        return YamlValue(line, column, items, "list", last=last)
    end = node.end_mark.column + 1 if last == line else 0
    if node.tag == NULL:
        return YamlValue(line, column, None, "nothing", last=last, end=end)
    kind = {TEXT: "text", WHOLE: "whole", REAL: "number"}.get(node.tag, "other")
    text = str(node.value)
    last -= node.style in ("|", ">")
    return YamlValue(line, column, text, kind, _number(text), last=last, end=end)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _explained(error: yaml.YAMLError, text: str) -> tuple[int, int, str]:
    """Return line and column, from 1, and the problem of a ``text`` that is not valid YAML."""
    if isinstance(error, ReaderError):
        lines = text[: error.position].split("\n")
        problem = f"The character U+{ord(text[error.position]):04X} is not allowed. Remove it."
        return len(lines), len(lines[-1]) + 1, problem
    assert isinstance(error, yaml.MarkedYAMLError)
    raw, mark, begin = str(error.problem), error.problem_mark, error.context_mark
    assert mark is not None
    for part, problem in (UNFINISHED | MISPLACED).items():
        if part in raw:
            if part in UNFINISHED and begin is not None and begin.line < mark.line:
                mark = begin
            return mark.line + 1, mark.column + 1, problem
    return mark.line + 1, mark.column + 1, f"This is not valid YAML: {raw}."
