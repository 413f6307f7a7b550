"""The table of programs in docs/exchange.md names the versions that the tests use."""

from __future__ import annotations

import re
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.exchange.tools import PINOCCHIO, PYBULLET, USD

PAGE = (Path(__file__).parents[2] / "docs" / "exchange.md").read_text(encoding="utf-8")

USED = {
    "PyBullet": PYBULLET.name.partition("==")[2],
    "pinocchio": PINOCCHIO.name.partition("==")[2],
    "usd-core": USD.name.partition("==")[2],
    "MuJoCo": version("mujoco-core"),
    "yourdfpy": version("yourdfpy"),
    "xacro": version("xacro"),
}
"""Versions by the names in the table."""


@pytest.mark.parametrize("program", USED)
def test_version_is_the_one_that_is_tested(program: str) -> None:
    named = re.findall(rf"^\| [^|]+ \| {program} ([0-9.]+)", PAGE, re.MULTILINE)
    assert named
    assert set(named) == {USED[program]}
