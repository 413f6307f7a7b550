"""Statements of CONTRIBUTING.md, the map and the list of extensions agree with the code."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import katana450
from docs import modes
from katana450.arm.control.commands.act import Traits
from katana450.cli.main import CORE_COMMANDS
from katana450.extension import extensions

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path(katana450.__file__).parent
TOUR = modes.FILE.read_text(encoding="utf-8")
MAP = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
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
    for name in (path for path in named if "NAME" not in path):
        assert any(path == name or path.endswith(f"/{name}") for path in known), name


def test_every_trait_of_a_command_is_explained() -> None:
    for field in dataclasses.fields(Traits):
        assert f"| `{field.name}" in TEXT, field.name


def test_lists_of_command_classes_are_those_that_the_recipe_names() -> None:
    """The calls of `match` name single classes; a list of classes is a tuple."""
    lists = {
        path.name
        for folder in ("arm", "server", "extensions")
        for path in (PACKAGE / folder).rglob("*.py")
        if re.search(r"\(cmd\.\w+, cmd\.\w+", path.read_text(encoding="utf-8"))
    }
    assert lists == {"undo.py"}
    assert all(name in TEXT for name in lists)


def test_map_names_the_commands_of_the_core() -> None:
    (row,) = re.findall(r"^ cli +(.*);", MAP, re.MULTILINE)
    assert row.split(", ") == [command.name for command in CORE_COMMANDS]


def test_map_has_the_layers_of_the_contract_from_top_to_bottom() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    rows = project["tool"]["importlinter"]["contracts"][0]["layers"]
    layers = [set(re.findall(r"\w+", row)) - {"__main__"} for row in rows]
    table = MAP.partition("## Layers")[2].partition("```text")[2].partition("```")[0]
    drawn = [
        {name for name in re.findall(r"\w+", row) if any(name in layer for layer in layers)}
        for row in re.findall(r"^ (\w+(?: \| \w+)*)", table, re.MULTILINE)
    ]
    assert drawn == layers


def test_tour_names_files_that_exist_and_the_number_of_those_of_a_drag() -> None:
    files = re.findall(r"`([\w/]+\.(?:py|js))`", TOUR)
    assert len(files) > 30
    assert all(
        (ROOT if name.startswith("static") else PACKAGE).joinpath(name).is_file() for name in files
    )
    drag = TOUR.partition("## One drag")[2].partition("\n## ")[0]
    numbered = re.findall(r"^\d+\. `([\w/]+\.py)`", drag, re.MULTILINE)
    assert f"in {len(numbered)} files" in drag
    assert len(set(numbered)) == len(numbered)


def test_diagram_of_the_modes_is_that_of_the_table() -> None:
    assert modes.content(TOUR) == TOUR, "run python -m docs.modes"


def test_every_part_of_the_extensions_folder_is_described() -> None:
    listed = (ROOT / "docs" / "extensions.md").read_text(encoding="utf-8")
    _, _, rest = listed.partition("The modules `convex_body`")
    used = rest.partition("add nothing by themselves")[0]
    parts = {path.stem for path in (PACKAGE / "extensions").iterdir() if path.name[0] != "_"}
    parts -= {"built_in"}
    registered = {extension.name for extension in extensions()}
    assert {"convex_body", *re.findall(r"`(\w+)`", used)} == parts - registered
    assert all(f"| `{name}` |" in listed for name in registered)
