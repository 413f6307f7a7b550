"""Check the size of the core: its rooms stay small enough to be read. See docs/decisions/0093."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterable
from pathlib import Path

import pytest

import katana450

PACKAGE = Path(katana450.__file__).parent
ROOMS = (
    *("maths/geometry", "maths/kinematics", "maths/collision", "maths/motion", "maths/planning"),
    *("arm/control", "arm/robot", "arm/drivers", "arm/runtime"),
    *("server/api", "server/service", "server/web", "server/viser_bridge", "server/view"),
    "cli",
)
MAX_LINES = 20_400

BESIDE = {"maths/water": 800, "assembly": 1_560, "": 730}
"""Further folders of the core with their maximum; "" holds the modules of the package itself."""

GROUPS = ("maths", "arm", "server", "assembly", "cli")
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


def lines_in(files: Iterable[Path]) -> int:
    return sum(code_lines(path.read_text(encoding="utf-8")) for path in files)


def test_rooms_do_not_grow() -> None:
    lines = {room: lines_in((PACKAGE / room).rglob("*.py")) for room in ROOMS}
    assert min(lines.values()) > 50
    assert sum(lines.values()) <= MAX_LINES, lines


@pytest.mark.parametrize(("folder", "maximum"), BESIDE.items())
def test_folders_beside_the_rooms_do_not_grow(folder: str, maximum: int) -> None:
    files = (PACKAGE / folder).rglob("*.py") if folder else PACKAGE.glob("*.py")
    assert 0.8 * maximum < lines_in(files) <= maximum


def test_every_folder_of_the_core_is_counted() -> None:
    counted = [PACKAGE / each for each in (*ROOMS, *BESIDE) if each]
    for group in GROUPS:
        for path in (PACKAGE / group).rglob("*.py"):
            above = any(path.is_relative_to(folder) for folder in counted)
            assert above or not code_lines(path.read_text(encoding="utf-8")), path


def test_only_code_is_counted() -> None:
    text = '"""A module.\n\nMore."""\n\n# Why.\nX = (\n    1,\n)\n"""[m]"""\n'
    assert code_lines(text) == 3
