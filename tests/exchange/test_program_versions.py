"""The tables of programs in docs/exchange.md name the versions and the tests that are used."""

from __future__ import annotations

import re
from importlib.metadata import version
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]

PAGE = (TESTS.parent / "docs" / "exchange.md").read_text(encoding="utf-8")

USED = {
    "MuJoCo": version("mujoco-core"),
    "yourdfpy": version("yourdfpy"),
}
"""Versions by the names in the table."""


@pytest.mark.parametrize("program", USED)
def test_version_is_the_one_that_is_tested(program: str) -> None:
    named = re.findall(rf"^\| [^|]+ \| {program} ([0-9.]+)", PAGE, re.MULTILINE)
    assert named
    assert set(named) == {USED[program]}


NOT_TESTED = ("MATLAB, Simulink, LabVIEW",)
"""Programs that were not available."""


def rows() -> list[dict[str, str]]:
    """Return the rows of the tables of programs by the names of their columns."""
    table: list[dict[str, str]] = []
    head: list[str] | None = None
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if cells[:2] == ["format", "program, version"]:
            head = cells
        elif not cells:
            head = None
        elif head is not None and "---" not in cells:
            table.append(dict(zip(head, cells, strict=True)))
    return table


def test_every_program_has_a_test() -> None:
    """Each row names files of tests, which exist and name the program."""
    table = rows()
    assert len(table) > 8
    for row in table:
        files = re.findall(r"`([^`]+)`", row["test"])
        assert bool(files) != (row["program, version"] in NOT_TESTED), row
        texts = [(TESTS / file).read_text(encoding="utf-8").lower() for file in files]
        assert all("def test_" in text for text in texts), row
        program = re.findall("[a-z_]+", row["program, version"].lower())[0]
        assert not texts or any(program in text for text in texts), row
