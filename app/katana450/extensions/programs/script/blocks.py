"""The steps of a script as blocks: ranges of lines of its text, which the page moves and copies.

A step that is commented out, as ``# - home`` in the column of its list, is a block too.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import msgspec

from katana450.extensions.programs.building.step import STEPS
from katana450.extensions.programs.language.source import ScriptError, YamlValue, read
from katana450.extensions.programs.script.script import KNOWN_STEPS, STEP_VALUES, Script
from katana450.extensions.programs.script.step_values import (
    Names,
    StepValue,
    names_in,
    step_values,
    values_of,
)

STEP_LISTS = ("steps", "then", "else")
"""Names of the fields of a step that hold steps."""

SETTINGS = ("tool", "speed", "let", "poses")
"""Names of the fields of a script, beside its steps, whose values have a block."""

MAX_TITLE = 60
"""Maximum number of characters of a title."""

MAX_VALUES = 40
"""Maximum number of values of a step that have fields."""

COMMENTED_STEP = re.compile(rf"( *)# - ({'|'.join(KNOWN_STEPS)})(:.*| *| +#.*)$")


@dataclass(frozen=True)
class TextBlock:
    """A step as lines of the text.

    Attributes:
        first, last: its lines, from 1, with the comments directly above it.
        line, column: place of the step itself, from 1.
        indent: column of its ``-``, from 0; None if it has no lines of its own.
        group: line at which its list begins.
        depth: number of the blocks around it.
        title: the step for people.
        enabled: whether it is not commented out.
        values: its values with their places, without those of the steps in it.
    """

    first: int
    last: int
    line: int
    column: int
    indent: int | None
    group: int
    depth: int
    title: str
    enabled: bool = True
    values: tuple[StepValue, ...] = ()


class _Source(NamedTuple):
    """The lines of a script, those of steps that are commented out, and the known names."""

    lines: Sequence[str]
    disabled: Collection[int]
    names: Names


def blocks_of(script: YamlValue, text: str, names: Names | None = None) -> tuple[TextBlock, ...]:
    """Return the steps of ``script``, which was read from ``text``, and first its settings.

    ``names``: known names of objects and tools, beside those that it gives.
    """
    lines = text.split("\n")
    if len(f"{text}.".splitlines()) != len(lines):
        return ()
    disabled = _uncomment(lines)
    try:
        script = read("\n".join(lines)) if disabled else script
    except ScriptError:
        lines, disabled = text.split("\n"), frozenset()
    known = names_in(script, names or {})
    source = _Source(lines, disabled, known)
    settings: list[TextBlock] = []
    blocks: list[TextBlock] = []
    for name, value in script.fields if script.kind == "mapping" else ():
        if name.held == "steps":
            blocks += _listed(value, source, 0, "")
        elif name.held in SETTINGS:
            place = value.line, value.last, value.line, value.column
            schema = Script.schema()["properties"][name.held]
            values = tuple(islice(values_of(value, schema, known, name.held), MAX_VALUES))
            title = f"{name.held} {_words(value)}"
            settings.append(TextBlock(*place, None, 0, 0, title, values=values))
    return (*settings, *blocks)


def _uncomment(lines: list[str]) -> frozenset[int]:
    """Remove the ``#`` before steps that are commented out; return their lines, from 1."""
    numbers = set()
    mark = None
    for number, line in enumerate(lines, 1):
        if match := COMMENTED_STEP.match(line):
            mark = f"{match[1]}#"
        elif mark is not None and line != mark and not line.startswith(f"{mark}  "):
            mark = None
        if mark is not None:
            lines[number - 1] = mark[:-1] + line[len(mark) + 1 :]
            numbers.add(number)
    return frozenset(numbers)


def _listed(value: YamlValue, source: _Source, depth: int, before: str) -> Iterator[TextBlock]:
    """Yield the blocks of a list, each followed by those in it. ``before``: begins each title."""
    lines, disabled, _ = source
    for item in value.items if value.kind == "list" else ():
        inner: list[TextBlock] = []
        for _, held in item.fields if item.kind == "mapping" else ():
            for name, steps in held.fields if held.kind == "mapping" else ():
                if name.held in STEP_LISTS:
                    prefix = "" if name.held == "steps" else f"{name.held}: "
                    inner += _listed(steps, source, depth + 1, prefix)
        enabled = item.line not in disabled
        first, last = item.line, max(item.last, *(block.last for block in inner), 0)
        # A list in brackets does not begin with the dash of its first step.
        indent = value.column - 1 if lines[first - 1].find("-") == value.column - 1 else None
        if indent is not None:
            while _comment_column(lines[first - 2]) == indent:
                first -= 1
            while last < len(lines) and _comment_column(lines[last]) > indent:
                if (last + 1 in disabled) == enabled:
                    break
                last += 1
        place, title = (first, last, item.line, item.column), before + _words(item)
        values = tuple(islice(_values(item, source), MAX_VALUES))
        yield TextBlock(*place, indent, value.line, depth, title, enabled, values)
        yield from inner if enabled else ()


def _values(step: YamlValue, source: _Source) -> Iterator[StepValue]:
    """Yield the values of a step; those of one that is commented out stand behind its ``# ``."""
    for name, held in step.fields if step.kind == "mapping" else ():
        schema = STEP_VALUES.get(str(name.held), {})
        values = step_values if name.held in STEPS else values_of
        shift = 2 * (step.line in source.disabled)
        for value in values(held, schema, source.names, _words(name)):
            if not (shift and value.before):
                place = {"column": value.column + shift, "end": value.end + shift}
                yield msgspec.structs.replace(value, **place)


def _comment_column(line: str) -> int:
    """Return the column of the ``#`` of a line that is a comment, from 0; -1 for another line."""
    return line.find("#") if line.lstrip().startswith("#") else -1


def _words(value: YamlValue) -> str:
    """Return a value as a person reads it, without the steps in it."""
    text = "" if value.held is None else str(value.held).replace("_", " ")
    if value.kind == "mapping":
        fields = (field for field in value.fields if field[0].held not in STEP_LISTS)
        text = ", ".join(f"{_words(name)} {_words(held)}".strip() for name, held in fields)
    elif value.kind == "list":
        items = (f"{x.number:.1f}" if x.kind == "number" else _words(x) for x in value.items)
        text = f"({', '.join(items)})"
    return textwrap.shorten(text, MAX_TITLE, placeholder=" …")
