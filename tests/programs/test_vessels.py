"""Vessels beside the cup: scripts pour into them, pick them, and pour from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.pouring import MAX_VESSELS, is_vessel
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import se3
from katana450.maths.water.units import MILLILITRE, ML, counted
from tests.programs.conftest import PREVIEW_TICK, Stage

SCENE = """\
frame: base
scene:
  objects:
  - {{name: cup, shape: cylinder, size: [32, 90], pose: [340, -260, 0, 0, 0, 0], can_be_held: true}}
  - {{name: basin, shape: cylinder, size: [126, 70], pose: [220, 360, 0, 0, 0, 0]}}
  - {{name: glass, shape: vessel, size: {size}, pose: {pose}, can_be_held: true}}
steps:
- fill: {full}
- grasp: {grasp}
- line: {{by: {{z: 140}}}}
{steps}
"""
"""A script with a glass on the table."""

BOTH = """\
- pour: {into: glass, ml: 100}
- pour: basin
- set_down
- pick: glass
- line: {by: {z: 60}}
- pour: basin
- set_down
"""


def started(stage: Stage, steps: str, **values: object) -> tuple[Program, State]:
    text = SCENE.format(
        **{"size": [30, 80], "pose": [420, 40, 0, 0, 0, 0], "full": 200, "grasp": "cup"}
        | {"steps": steps}
        | values
    )
    script = parse(text)
    assert script.scene is not None
    state = script.scene.begin(stage.session)
    return compiled(script, stage.plan_context, state), state


def glass_of(state: State) -> float:
    """Return the water in the glass [ml]; 0 before there is water."""
    vessel = None if state.poured is None else state.poured.water.vessel("glass")
    return 0.0 if vessel is None else vessel.volume / MILLILITRE


@pytest.mark.long
def test_half_of_the_cup_is_poured_into_a_glass_and_all_into_the_basin(stage: Stage) -> None:
    program, start = started(stage, BOTH)
    run, states = stage.play(program, start, most=20_000)
    assert (run.phase, run.why) == (Phase.DONE, "")
    waters = [state.poured.water for state in states if state.poured is not None]
    assert {water.total for water in waters if water.total} == {counted(200 * ML)}
    glass = max(states, key=glass_of)
    assert glass_of(glass) == pytest.approx(100.0, abs=1.0)
    assert (waters[-1].spilled, waters[-1].air) == (0, 0)
    assert waters[-1].basin / MILLILITRE == pytest.approx(200.0, abs=1.0)
    assert stage.loads(states).max() <= 1.0 + 1e-6
    # The glass is carried upright while it is full, and put back.
    full = [s for s in states if s.held is not None and s.held.name == "glass"]
    full = [s for s in full if glass_of(s) > 99.0]
    assert stage.session.pouring is not None
    margins = [stage.session.pouring.margin_to_rim(s.poured, s.objects) for s in full if s.poured]
    assert min(margins[:-50]) > 0.0
    (poured,) = (vessel for vessel in states[-1].objects if vessel.name == "glass")
    np.testing.assert_allclose(poured.T[:3, 3], (0.42, 0.04, 0.0), atol=1e-3)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("full", "pour", "size", "pose"),
    [
        (220, "{into: glass, ml: 20}", [25, 60], [380, -100, 0, 0, 0, 0]),
        (150, "{into: glass, ml: 80}", [40, 120], [450, -100, 0, 0, 0, 0]),
        (100, "{into: glass, shake: 0}", [30, 80], [420, 40, 0, 0, 0, 0]),
    ],
)
def test_nothing_is_spilled_beside_a_glass(
    stage: Stage, full: int, pour: str, size: list[int], pose: list[int]
) -> None:
    program, start = started(stage, f"- pour: {pour}\n", full=full, size=size, pose=pose)
    run, states = stage.play(program, start, 20_000, PREVIEW_TICK)
    assert (run.phase, run.why) == (Phase.DONE, "")
    assert states[-1].poured is not None
    water = states[-1].poured.water
    assert (water.spilled, water.basin) == (0, 0)
    assert glass_of(states[-1]) + water.cup.volume / MILLILITRE == pytest.approx(full)
    assert stage.loads(states).max() <= 1.0 + 1e-6


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ("- pour: {into: glass}", "glass has room for 192.2 ml, which is less than the 200.0 ml"),
        (
            "- set_down\n- pour: basin",
            "No vessel is in the hand: `grasp` the cup or a vessel first",
        ),
        ("- pour: {into: cup}", "cup is in the hand: name what stands below it"),
        ("- set_down\n- pick: {object: glass, side: above}", "a vessel is grasped from the front"),
        ("- place: {on: glass}", "glass is open at its top and cannot carry cup"),
    ],
)
def test_impossible_pour_is_refused(stage: Stage, steps: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said):
        started(stage, steps, grasp="{object: cup, pitch: 30}")


def glass(number: int) -> SceneObject:
    T = se3.from_rotation_translation(np.eye(3), (0.3 + 0.04 * number, 0.0, 0.0))
    return SceneObject(f"glass {number}", Shape.VESSEL, (0.015, 0.05), T, can_be_held=True)


def test_vessels_come_and_go_with_their_water(stage: Stage) -> None:
    session, state = stage.session, stage.begin()
    for command in (cmd.Fill(100.0), cmd.PlaceObject(glass(0)), cmd.PlaceObject(glass(1))):
        state = session.step(state, [command], state.t + 0.01)
    assert state.poured is not None
    assert [vessel.name for vessel in state.poured.water.vessels] == ["cup", "glass 0", "glass 1"]
    again = session.step(state, [], state.t + 0.01)
    assert again.poured is state.poured
    removed = session.step(state, [cmd.Remove("glass 0")], state.t + 0.01)
    assert removed.poured is not None
    assert [vessel.name for vessel in removed.poured.water.vessels] == ["cup", "glass 1"]
    assert removed.poured.water.total == state.poured.water.total
    assert session.step(state, [cmd.Remove("cup")], state.t + 0.01).poured is None


def test_scene_has_few_vessels(stage: Stage) -> None:
    state = stage.begin()
    cup = tuple(scene_object for scene_object in state.objects if is_vessel(scene_object))
    some = tuple(map(glass, range(MAX_VESSELS - 1)))
    stage.session.check(cmd.ReplaceScene((*cup, *some), 1e-4))
    with pytest.raises(InputError, match=f"at most {MAX_VESSELS} vessels with the cup"):
        stage.session.check(cmd.ReplaceScene((*cup, *some, glass(MAX_VESSELS)), 1e-4))


def test_basin_is_no_vessel(stage: Stage) -> None:
    with pytest.raises(InputError, match="give the vessel another name"):
        stage.session.check(cmd.PlaceObject(replace(glass(1), name="basin")))
