"""Syntax errors of YAML in words for people: the place of the mistake, and what to do."""

from __future__ import annotations

import yaml
from yaml.reader import ReaderError

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


def explained(error: yaml.YAMLError, text: str) -> tuple[int, int, str]:
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
