"""Test ``include``: names from files beside a script, and errors with their file and line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.extensions.programs.language.attached_files import (
    MAX_FILES,
    attached,
    attached_file,
    without_scene,
)
from katana450.extensions.programs.language.source import Problem, ScriptError, read
from katana450.extensions.programs.language.step_target import StepTarget
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import Scripts, files_in, script_text
from katana450.extensions.programs.steps.moves import Move
from katana450.extensions.programs.steps.settings_steps import TimedPause
from tests.programs.conftest import Stage

PARTS = """\
# A library.
frame: base
let: {long: 2 s}
poses:
  corner: {x: 320, y: 0, z: 150, pitch: 50, roll: 0}
define:
  rest:
    with: {time: long}
    steps:
      - wait: time
"""

SCRIPT = """\
frame: base
include: parts.yaml   # the library
steps:
  - move: corner
  - call: rest
  - call: {name: rest, with: {time: 3}}
"""


def whole(script: str, files: Mapping[str, str]) -> str:
    """Return ``script`` with the texts of ``files``."""

    def opened(name: str) -> str:
        if name not in files:
            raise InputError(f"{name} cannot be read: it is not there.")
        return files[name]

    return attached(script, opened)


def problems(script: str, files: Mapping[str, str]) -> tuple[Problem, ...]:
    with pytest.raises(ScriptError) as refused:
        parse(whole(script, files))
    return refused.value.problems


def test_names_of_a_file_are_known() -> None:
    text = whole(SCRIPT, {"parts.yaml": PARTS})
    assert text.count("\n") == SCRIPT.count("\n")
    assert text.splitlines()[1].endswith("   # the library")
    move, first, second = parse(text).steps
    assert isinstance(move.step, Move)
    assert isinstance(move.step.to, StepTarget)
    assert move.step.to.position is not None
    assert move.step.to.position.tolist() == [0.32, 0.0, 0.15]
    assert (first.step, second.step) == (TimedPause(2.0), TimedPause(3.0))
    # A step has its place in the file, and the line of the script that calls it.
    assert (first.file, first.line, first.script_line) == ("parts.yaml", 10, 5)
    assert (second.file, second.line, second.script_line) == ("parts.yaml", 10, 6)
    assert move.script_line == 4


def test_steps_of_a_file_have_the_line_of_their_call(stage: Stage) -> None:
    nested = PARTS + "  twice:\n    steps:\n      - if: {held: cup, then: [{call: rest}]}\n"
    script = SCRIPT.replace("call: rest\n", "call: twice\n")
    program = compiled(
        parse(whole(script, {"parts.yaml": nested})), stage.plan_context, stage.begin()
    )
    assert [task.line for task in program.tasks[1:]] == [4, 5, 5, 6]


@pytest.mark.parametrize(
    "field",
    [
        "include: [a.yaml, parts.yaml]",
        "include:\n  - a.yaml\n  - parts.yaml",
        '"include": {"a.yaml": "let: {a: 1}"}',
    ],
)
def test_several_files_are_included_in_their_order(field: str) -> None:
    files = {"a.yaml": "let: {a: 1 s}\ndefine: {one: {steps: [{wait: a}]}}", "parts.yaml": PARTS}
    script = f"frame: base\n{field}\nsteps:\n  - wait: 2 * a\n"
    assert parse(whole(script, files)).steps[0].step == TimedPause(2.0)


def test_own_names_take_precedence() -> None:
    script = (
        "frame: base\ninclude: parts.yaml\nlet: {long: 5 s}\n"
        "steps:\n  - wait: long\n  - call: rest\n"
    )
    own, included = parse(whole(script, {"parts.yaml": PARTS})).steps
    assert (own.step, included.step) == (TimedPause(5.0), TimedPause(2.0))


def test_file_that_several_files_include_is_read_once() -> None:
    files = {
        "a.yaml": "include: base.yaml\nlet: {a: unit + 1}",
        "b.yaml": "include: [base.yaml, a.yaml]\nlet: {b: a + unit}",
        "base.yaml": "let: {unit: 2}",
    }
    text = whole("include: [a.yaml, b.yaml]\nsteps:\n  - wait: a + b\n", files)
    assert text.count("let: {unit: 2}") == 1
    assert parse(text).steps[0].step == TimedPause(8.0)


@pytest.mark.parametrize(
    ("files", "file", "line", "said"),
    [
        ({}, "", 2, "parts.yaml cannot be read"),
        ({"parts.yaml": "let: {a: 1}\npose: {}"}, "parts.yaml", 2, "no 'pose'"),
        ({"parts.yaml": "steps: [home]"}, "parts.yaml", 1, "An included file has no 'steps'"),
        ({"parts.yaml": "define: {\n a: {steps: [hme]}}"}, "parts.yaml", 2, "did you mean 'home'"),
        ({"parts.yaml": "let: [1"}, "parts.yaml", 1, "A comma or ] is missing in a list"),
        ({"parts.yaml": ""}, "parts.yaml", 1, "The file is empty"),
        ({"parts.yaml": "# a\nframe: shoulder"}, "parts.yaml", 2, "in the frame shoulder"),
        ({"parts.yaml": "let: {a: &b 1}"}, "parts.yaml", 1, "Anchors"),
        ({"parts.yaml": "include: parts.yaml"}, "parts.yaml", 1, "parts.yaml includes parts.yaml"),
        (
            {"parts.yaml": "\ninclude: b.yaml", "b.yaml": "\n\ninclude: parts.yaml"},
            "b.yaml",
            3,
            "in a circle: parts.yaml includes b.yaml includes parts.yaml",
        ),
        ({"parts.yaml": "\ninclude: no.yaml"}, "parts.yaml", 2, "no.yaml cannot be read"),
        ({"parts.yaml": "include: ../b.yaml"}, "parts.yaml", 1, "not the name of a .yaml file"),
    ],
)
def test_mistake_is_refused_with_its_file_and_line(
    files: dict[str, str], file: str, line: int, said: str
) -> None:
    found = problems(SCRIPT, files)
    assert any(each.file == file and each.line == line and said in each.text for each in found), (
        found
    )


@pytest.mark.parametrize(
    "name",
    [
        "/etc/a.yaml",
        "../a.yaml",
        "b/../../a.yaml",
        "a.txt",
        "C:a.yaml",
        "b\\a.yaml",
        " ",
        "3",
        "{}",
    ],
)
def test_name_outside_the_folder_is_refused(name: str) -> None:
    (problem,) = problems(f"include: '{name}'\nsteps: [home]\n", {name: "let: {a: 1}"})
    assert problem.line == 1
    (problem,) = problems(f"scene: '{name}'\nsteps: [home]\n", {name: "scene: 1"})
    assert problem.line == 1


def test_script_that_does_not_stand_alone_is_refused() -> None:
    with pytest.raises(ScriptError, match="a script that is sent stands alone"):
        parse(SCRIPT)
    with pytest.raises(ScriptError, match="a script that is sent stands alone"):
        parse("scene: boxes.yaml\nsteps: [home]")


def test_number_and_size_of_files_are_bounded() -> None:
    files = {f"{n}.yaml": f"include: {n + 1}.yaml" for n in range(MAX_FILES + 1)}
    files[f"{MAX_FILES + 1}.yaml"] = "let: {a: 1}"
    (problem,) = problems("include: 0.yaml\nsteps: [home]", files)
    assert f"at most {MAX_FILES} files" in problem.text
    texts = ", ".join(f"'{n}.yaml': 'let: {{}}'" for n in range(MAX_FILES + 1))
    with pytest.raises(ScriptError, match=f"at most {MAX_FILES} files"):
        parse(f"include: {{{texts}}}\nsteps: [home]")
    with pytest.raises(ScriptError, match="at most 64 KB"):
        parse(whole(SCRIPT, {"parts.yaml": PARTS + "#" * 65_300}))
    (problem,) = problems(SCRIPT, {"parts.yaml": PARTS + "#" * 70_000})
    assert problem == Problem(2, 10, "parts.yaml has more than 64 KB.")


@settings(max_examples=50)
@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=60))
def test_every_text_is_attached_unchanged(text: str) -> None:
    found = read(attached("include: a.yaml\nsteps: [home]\n", lambda _: text))
    ((_, value), _) = found.fields
    assert attached_file(value).texts == {"a.yaml": text}


def test_damaged_script_is_left_to_its_reader() -> None:
    for text in ("include: [a.yaml", "", "- include", "include: &a b.yaml"):
        assert whole(text, {}) == text


def test_files_are_read_from_the_folder_of_the_script_only(tmp_path: Path) -> None:
    inner = tmp_path / "scripts"
    (inner / "below").mkdir(parents=True)
    (tmp_path / "out.yaml").write_text("let: {a: 1}", encoding="utf-8")
    (inner / "below" / "in.yaml").write_text("let: {long: 4}", encoding="utf-8")
    (inner / "link.yaml").symlink_to(tmp_path / "out.yaml")
    opened = files_in(inner)
    assert opened("below/in.yaml") == "let: {long: 4}"
    for name in ("../out.yaml", "link.yaml", str(tmp_path / "out.yaml")):
        with pytest.raises(InputError, match="is not in the folder of the script"):
            opened(name)
    script = inner / "mine.yaml"
    script.write_text("include: below/in.yaml\nsteps:\n  - wait: long\n", encoding="utf-8")
    assert parse(script_text(script)).steps[0].step == TimedPause(4.0)
    assert parse(Scripts(inner).text("mine")).steps[0].step == TimedPause(4.0)


@pytest.mark.parametrize(
    "text",
    [
        "name: A\nscene: a.yaml\nsteps:\n  - home\n",
        "scene:\n  - {name: a, shape: box}\n  - {name: b}\nname: A\nsteps:\n  - home\n",
        "scene:\n- {name: a}\n\n# a comment\nname: A\nsteps:\n  - home\n",
        "steps:\n  - home\nname: A\nscene: {objects: []}",
        "{name: A, scene: {objects: [\n]}, steps: [\nhome]}",
    ],
)
def test_script_without_its_scene_keeps_its_lines(text: str) -> None:
    found = without_scene(text)
    assert found.count("\n") == text.count("\n")
    script = parse(found)
    assert (script.scene, script.name, len(script.steps)) == (None, "A", 1)
    at = text.count("\n", 0, text.index("home")) + 1
    assert script.steps[0].line == at
