"""Check the size of the core: it stays small enough to be read."""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path

import katana450

PACKAGE = Path(katana450.__file__).parent
CORE = ("maths", "arm", "server", "assembly", "cli")
MAX_LINES = 25_300
SILENT = frozenset(
    (
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
)


def code_lines(text: str) -> int:
    """Return the number of lines that hold code: no docstring, comment or blank line."""
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Expr(value=ast.Constant(value=str()), end_lineno=int(last)):
                docstrings.update(range(node.lineno, last + 1))
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SILENT:
            code.update(range(token.start[0], token.end[0] + 1))
    return len(code - docstrings)


def test_core_has_at_most_25300_lines_of_code() -> None:
    files = [*PACKAGE.glob("*.py")]
    for name in CORE:
        files += (PACKAGE / name).rglob("*.py")
    assert 10_000 < sum(code_lines(path.read_text(encoding="utf-8")) for path in files) <= MAX_LINES


def test_only_code_is_counted() -> None:
    text = '"""A module.\n\nMore."""\n\n# Why.\nX = (\n    1,\n)\n"""[m]"""\n'
    assert code_lines(text) == 3
