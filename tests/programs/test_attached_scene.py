"""Test the scene file that a script names: its text in the script, and errors with their place."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.extensions.programs.language.attached_files import (
    attached,
    attached_file,
    without_scene,
)
from katana450.extensions.programs.language.source import Problem, ScriptError, read
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import Scripts, files_in, script_text

SCENE = "scene: 1\nobjects:\n- {name: a, shape: box, size: [9, 9, 9], pose: [300, 0, 0, 0, 0, 0]}\n"
SCRIPT = "name: A\nscene: a.yaml   # the scene\nsteps:\n  - home\n"


def problem_of(script: str, text: str) -> Problem:
    """Return the only problem of ``script``, whose file has ``text``."""
    with pytest.raises(ScriptError) as refused:
        parse(attached(script, lambda _: text))
    (problem,) = refused.value.problems
    return problem


def test_text_of_the_scene_is_attached_on_its_line() -> None:
    text = attached(SCRIPT, lambda _: SCENE)
    assert text.count("\n") == SCRIPT.count("\n")
    assert text.splitlines()[1].endswith("   # the scene")
    scene = parse(text).scene
    assert scene is not None
    assert [entry.name for entry in scene.draft.entries] == ["a"]


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("objects: []", 1, "A scene needs 'scene'"),
        ("# a\nscene: 1\nobject: []", 3, "no 'object'"),
        ("scene: [1", 1, "A comma or ] is missing in a list"),
        ("scene: &b 1", 1, "Anchors"),
    ],
)
def test_mistake_is_refused_with_its_file_and_line(text: str, line: int, said: str) -> None:
    problem = problem_of(SCRIPT, text)
    assert (problem.file, problem.line) == ("a.yaml", line)
    assert said in problem.text


@pytest.mark.parametrize(
    "name", ["/etc/a.yaml", "../a.yaml", "b/../../a.yaml", "a.txt", "C:a.yaml", "b\\a.yaml", " "]
)
def test_name_outside_the_folder_is_refused(name: str) -> None:
    assert problem_of(f"scene: '{name}'\nsteps: [home]\n", SCENE).line == 1


def test_script_that_does_not_stand_alone_is_refused() -> None:
    with pytest.raises(ScriptError, match="a script that is sent stands alone"):
        parse(SCRIPT)


def test_size_of_the_file_is_bounded() -> None:
    assert problem_of(SCRIPT, "#" * 70_000) == Problem(2, 8, "a.yaml has more than 64 KB.")


@settings(max_examples=50)
@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=60))
def test_every_text_is_attached_unchanged(text: str) -> None:
    whole = read(attached("scene: a.yaml\nsteps: [home]\n", lambda _: text))
    ((_, value), _) = whole.fields
    assert attached_file(value) == ("a.yaml", text)


def test_damaged_script_is_left_to_its_reader() -> None:
    for text in ("scene: [a.yaml", "", "- scene", "scene: &a b.yaml"):
        assert attached(text, lambda _: SCENE) == text


def test_files_are_read_from_the_folder_of_the_script_only(tmp_path: Path) -> None:
    inner = tmp_path / "scripts"
    (inner / "below").mkdir(parents=True)
    (tmp_path / "out.yaml").write_text(SCENE, encoding="utf-8")
    (inner / "below" / "in.yaml").write_text(SCENE, encoding="utf-8")
    (inner / "link.yaml").symlink_to(tmp_path / "out.yaml")
    opened = files_in(inner)
    assert opened("below/in.yaml") == SCENE
    for name in ("../out.yaml", "link.yaml", str(tmp_path / "out.yaml")):
        with pytest.raises(InputError, match="is not in the folder of the script"):
            opened(name)
    script = inner / "mine.yaml"
    script.write_text("scene: below/in.yaml\nsteps:\n  - home\n", encoding="utf-8")
    assert parse(script_text(script)).scene is not None
    assert parse(Scripts(inner).text("mine")).scene is not None
    with pytest.raises(ScriptError, match="cannot be read"):
        attached("scene: gone.yaml", opened)


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
    rest = without_scene(text)
    assert rest.count("\n") == text.count("\n")
    script = parse(rest)
    assert (script.scene, script.name, len(script.steps)) == (None, "A", 1)
    line = text.count("\n", 0, text.index("home")) + 1
    assert script.steps[0].line == line
