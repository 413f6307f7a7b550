"""Test the JSON Schema of scripts against the reader of scripts."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from docs.script_schema import FILE, content
from katana450.extensions.programs.language.declaration import Schema
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.script.script import (
    BLOCKS,
    STEP_VALUES,
    WITHOUT_VALUE,
    parse,
    script_schema,
)
from katana450.extensions.programs.steps.steps import STEPS
from tests.programs.yaml_core import loaded

ROOT = Path(__file__).resolve().parents[2]
VALIDATOR = Draft202012Validator(script_schema())


def scripts() -> Iterator[tuple[str, str]]:
    """Yield the name and the text of every script of the project."""
    library = ROOT / "app" / "katana450" / "extensions" / "programs" / "library"
    for folder in (ROOT / "examples" / "programs", library):
        for path in sorted(folder.rglob("*.yaml")):
            yield path.name, path.read_text(encoding="utf-8")
    for page in ("README.md", "docs/programs.md"):
        blocks = re.findall(r"```yaml\n(.*?)```", (ROOT / page).read_text("utf-8"), re.DOTALL)
        for number, block in enumerate(blocks):
            if "steps:" in block:
                yield f"{page} {number}", block


SCRIPTS = dict(scripts())


def is_valid(text: str) -> bool:
    return bool(VALIDATOR.is_valid(loaded(text)))


def known_fields(text: str, name: str = "zzz") -> set[str]:
    """Return the fields that the reader of scripts names instead of the field ``name``."""
    with pytest.raises(ScriptError) as refused:
        parse(text)
    for problem in refused.value.problems:
        if match := re.search(rf"has no '{name}'; it may have `(.*)`\.", problem.text):
            return set(match[1].split("`, `"))
    raise AssertionError(refused.value.problems)


def mappings(schema: Schema) -> list[dict[str, Any]]:
    """Return the properties of each mapping that ``schema`` allows at its top."""
    options = [schema, *schema.get("anyOf", ())]
    return [option["properties"] for option in options if "properties" in option]


def test_schema_is_a_schema_and_the_file_for_editors_is_current() -> None:
    Draft202012Validator.check_schema(script_schema())
    assert FILE.read_text(encoding="utf-8") == content(), "run `python -m docs.script_schema`"
    for path in FILE.parent.rglob("*.yaml"):
        schema = Path(os.path.relpath(FILE, path.parent)).as_posix()
        assert f"$schema={schema}" in path.read_text(encoding="utf-8").splitlines()[0]


@pytest.mark.parametrize("name", SCRIPTS)
def test_schema_accepts_every_script_of_the_project(name: str) -> None:
    parse(SCRIPTS[name])
    errors = [error.message for error in VALIDATOR.iter_errors(loaded(SCRIPTS[name]))]
    assert errors == []


def test_schema_has_every_field_of_a_script_and_every_step() -> None:
    assert known_fields("zzz: 1\nsteps: [home]") == set(script_schema()["properties"])
    assert set(STEP_VALUES) == {*STEPS, *BLOCKS}
    for name in WITHOUT_VALUE:
        parse(f"steps: [{name}]")


@pytest.mark.parametrize("name", [step for step in STEP_VALUES if mappings(STEP_VALUES[step])])
def test_schema_has_every_field_of_a_step(name: str) -> None:
    *_, properties = mappings(STEP_VALUES[name])
    extra = {"joints"} if name == "move" else set()
    assert known_fields(f"steps:\n  - {name}: {{zzz: 1}}") == {*properties, *extra}


def test_schema_has_every_field_of_a_place() -> None:
    place = script_schema()["$defs"]["place"]
    _, point = mappings(place)
    assert known_fields("steps:\n  - move: {zzz: 1}") == {*point, "joints"}
    assert known_fields("steps:\n  - move: {joints: [1, 2, 3, 4, 5], zzz: 1}") == {"joints"}


@pytest.mark.parametrize(
    "wrong",
    [
        "steps: []",
        "name: x",
        "steps: [hme]",
        "steps: [{home: 3}]",
        "steps: [{home: , wait: 1}]",
        "steps: [{wait: -1}]",
        "steps: [{wait: 4000}]",
        "steps: [{speed: 1.5}]",
        "steps: [{joints: [1, 2]}]",
        "steps: [{line: {to: {x: 1, y: 2}}}]",
        "steps: [{line: {too: [1, 2, 3]}}]",
        "steps: [{line: {to: [1, 2, 3], by: [1, 2, 3]}}]",
        "steps: [{trajectory: {}}]",
        "steps: [{place: {}}]",
        "steps: [{repeat: {times: 2, index: i, until: {held: cup}, steps: [home]}}]",
        "steps: [{lines: {through: [[1, 2, 3]]}}]",
        "steps: [{arc: {axis: x, angle: 20}}]",
        "steps: [{nudge: {axis: 33, by: 1}}]",
        "steps: [{circle: {centre: [1, 2, 3], normal: x, radius: 0}}]",
        "steps: [{move: {x: 1, y: 2, z: 3, branch: elbow}}]",
        "steps: [{repeat: {times: 0, steps: [home]}}]",
        "steps: [{repeat: {times: 2, steps: []}}]",
        "steps: [{pour: {shake: 1}}]",
        "frame: world\nsteps: [home]",
        "speeed: 1\nsteps: [home]",
        "expect: {speed: {at_most: 1}}\nsteps: [home]",
        "poses: {a: {x: 1}}\nsteps: [home]",
    ],
)
def test_what_the_schema_refuses_the_reader_refuses_too(wrong: str) -> None:
    assert not is_valid(wrong)
    with pytest.raises(ScriptError):
        parse(wrong)
