"""The recipes of CONTRIBUTING.md name only files and traits that exist."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from katana450.arm.control.traits import CommandTraits

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_files_that_the_recipes_name_exist() -> None:
    named = set(re.findall(r"`([\w./]+\.(?:py|md|js|html))`", TEXT))
    named |= set(re.findall(r"\]\(([\w./]+)\)", TEXT))
    assert len(named) > 20
    known = {
        path.relative_to(ROOT).as_posix()
        for top in ("app", "docs", "static", "tests")
        for path in (ROOT / top).rglob("*")
    } | {path.name for path in ROOT.glob("*.md")}
    for name in (each for each in named if "NAME" not in each):
        assert any(path == name or path.endswith(f"/{name}") for path in known), name


def test_every_trait_of_a_command_is_explained() -> None:
    for field in dataclasses.fields(CommandTraits):
        assert f"| `{field.name}" in TEXT, field.name
