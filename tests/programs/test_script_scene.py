"""Test ``scene`` of a script: its forms, its use in a simulation, and the check of a server."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.simulation import plan_script
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_scene import SceneDraft
from katana450.maths.water.units import MILLILITRE
from katana450.resources import URDF_PATH
from tests.programs.conftest import TICK, Stage

POST = "{name: post, shape: box, size: [30, 30, 250], pose: [330, 0, 0, 0, 0, 20]}"
AT = "pose: [300, 200, 0, 0, 0, 0]"
CUP = f"{{name: cup, shape: cylinder, size: [32, 90], {AT}, can_be_held: true}}"
STEPS = "steps:\n  - home\n"

WHOLE = f"""\
scene:
  joints: [10, -68, 85, 8, 0]
  water: 50
  objects:
  - {POST}
  - {CUP}
{STEPS}"""


def scene_of(text: str) -> SceneDraft:
    scene = parse(text).scene
    assert scene is not None
    return scene


@pytest.fixture(scope="module")
def scene() -> SceneDraft:
    return scene_of(WHOLE)


@pytest.fixture(scope="module")
def beginning(stage: Stage, scene: SceneDraft) -> State:
    return scene.begin(stage.session)


def test_scene_begins_with_its_joints_and_water(beginning: State) -> None:
    assert [scene_object.name for scene_object in beginning.objects] == ["post", "cup"]
    assert np.degrees(beginning.setpoint[0]) == pytest.approx(10.0)
    assert beginning.poured is not None
    assert beginning.poured.water.cup.volume / MILLILITRE == pytest.approx(50.0)


@pytest.mark.parametrize(
    "field",
    [
        f"scene:\n  - {POST}",
        f"scene: [{POST}]",
        f"scene:\n  objects:\n  - {POST}",
        f"scene: {{scene: 1, objects: [{POST}]}}",
        f"let: {{wide: 3 cm}}\nscene: [{POST.replace('30, 30, 250', 'wide, wide, 250')}]",
    ],
)
def test_objects_may_be_in_the_script(stage: Stage, field: str) -> None:
    (post,) = scene_of(f"{field}\n{STEPS}").begin(stage.session).objects
    assert post.size == pytest.approx((0.03, 0.03, 0.25))
    assert post.T[:3, 3].tolist() == pytest.approx([0.33, 0.0, 0.0])


def test_simulation_uses_the_scene_of_the_script() -> None:
    line = (
        "frame: base\ntool: tcp\nsteps:\n"
        "  - move: {x: 320, y: -100, z: 150, pitch: 50, roll: 0}\n  - line: {by: {y: 200}}\n"
    )
    with pytest.raises(ScriptError, match="post") as refused:
        plan_script(parse(f"scene: [{POST}]\n{line}"), URDF_PATH)
    assert refused.value.problems[0].line == 6


def test_present_scene_is_accepted(stage: Stage, scene: SceneDraft, beginning: State) -> None:
    scene.check_present(stage.session, beginning)
    elsewhere = stage.session.begin(stage.session.ready, 0.5, 0.0)
    elsewhere = replace(elsewhere, objects=beginning.objects, poured=beginning.poured)
    scene.check_present(stage.session, elsewhere)


@pytest.mark.parametrize(
    ("old", "new", "difference"),
    [
        ("330, 0, 0", "331, 0, 0", "post is elsewhere, at (331.0, 0.0, 0.0) mm"),
        ("0, 0, 20]", "0, 0, 25]", "post is turned"),
        ("[30, 30, 250]", "[30, 31, 250]", "post has another shape, size or scale"),
        (", 250]", ", 250], scale: 0.5", "post has another shape, size or scale"),
        (", 0, 20]", ", 0, 20], can_be_held: true", "post has another `can_be_held`"),
        (", 0, 20]", ", 0, 20], zone: slow", "post has another `can_be_held` or `zone`"),
        ("- {name: post", "- {name: pole", "there is no object 'post'"),
        ("objects:", f"objects:\n  - {{name: ball, shape: sphere, size: [20], {AT}}}",
         "there is also ball"),
        ("water: 50", "water: 70", "the cup has 70.0 ml of water, not 50.0 ml of water"),
    ],
)  # fmt: skip
def test_first_difference_is_named(
    stage: Stage, scene: SceneDraft, old: str, new: str, difference: str
) -> None:
    present = scene_of(WHOLE.replace(old, new, 1)).begin(stage.session)
    with pytest.raises(ScriptError) as refused:
        scene.check_present(stage.session, present)
    assert f"not that of the script: {difference}" in str(refused.value)
    assert refused.value.problems[0].line == 2


def test_held_object_is_a_difference(stage: Stage, scene: SceneDraft, beginning: State) -> None:
    post, cup = beginning.objects
    present = replace(beginning, objects=(post, replace(cup, held=True)))
    with pytest.raises(ScriptError, match="cup is in the hand"):
        scene.check_present(stage.session, present)


def test_meshes_are_compared_without_their_forms(stage: Stage, beginning: State) -> None:
    mesh = f"{{name: cup, shape: mesh, mesh: {{file: a.stl}}, {AT}}}"
    scene = scene_of(f"scene: [{mesh}]\n{STEPS}")
    with pytest.raises(ScriptError, match="cup has another shape"):
        scene.check_present(stage.session, beginning)
    with pytest.raises(ScriptError, match="cup is a mesh, whose file is not read here") as refused:
        scene.begin(stage.session)
    assert refused.value.problems[0].line == 1


@pytest.mark.parametrize(
    ("field", "said"),
    [
        (f"scene:\n  - {POST}\n  - {POST}", "two objects called 'post'"),
        ("scene:\n  - {name: a, shape: bax}", "not 'bax'"),
        ("scene: 3", "A scene must be a mapping"),
        ("scene: boxes.yaml", "run it with `--scene` and the file"),
        ("scene:\n  objects:\n  - {name: a, shape: cone}", "line 3, column 22: Expected one of"),
        ("scene: {water: 3, colour: red}", "has no 'colour'"),
        ("scene: {scene: 2, objects: []}", "version must be 1"),
    ],
)
def test_mistake_is_refused(field: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said):
        parse(f"{field}\n{STEPS}")


def test_scene_that_is_impossible_is_refused(stage: Stage) -> None:
    high = POST.replace("330, 0, 0", "330, 0, 100").replace("]}", "], can_be_held: true}")
    for field, said in (
        (f"{{joints: [10, 0, 0, 0, 999], objects: [{POST}]}}", "outside the limits"),
        (f"{{water: 10, objects: [{POST}]}}", "no cup"),
        (f"[{high}]", "in the air"),
    ):
        with pytest.raises(InputError, match=said) as refused:
            scene_of(f"\nscene: {field}\n{STEPS}").begin(stage.session)
        assert isinstance(refused.value, ScriptError)
        assert refused.value.problems[0].line == 2


def test_water_of_a_script_without_water_is_none(stage: Stage) -> None:
    scene = scene_of(f"scene: [{CUP}]\n{STEPS}")
    state = scene.begin(stage.session)
    scene.check_present(stage.session, state)
    state = stage.session.step(state, (cmd.Fill(30.0),), state.t + TICK)
    with pytest.raises(ScriptError, match=r"the cup has 30\.0 ml of water, not 0\.0 ml"):
        scene.check_present(stage.session, state)
