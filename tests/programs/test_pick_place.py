"""Tests of the steps that pick objects up, place them, stack them and let them go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan, Task
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.kinds import Spot
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.steps.place import Pick, PlaceHeld
from katana450.maths.geometry import se3, so3
from katana450.maths.planning.plan import MARGIN
from tests.programs.conftest import PREVIEW_TICK, TICK, Stage

NEAR, AT = (240.0, 90.0), (230.0, -120.0)
"""[mm] Places on the table that the arm reaches from above."""

LOW = (40.0, 40.0, 60.0)
"""[mm] Size of a box in whose middle the hand from above has no room."""


def box(
    name: str,
    xy: tuple[float, float],
    size: tuple[float, ...] = (40.0, 40.0, 80.0),
    *,
    yaw: float = 0.0,
    shape: Shape = Shape.BOX,
) -> SceneObject:
    """Return an object that can be held; lengths in mm, the yaw in deg."""
    T = se3.from_rotation_translation(so3.rotation_z(np.radians(yaw)), 1e-3 * np.array((*xy, 0.0)))
    return SceneObject(name, shape, tuple(1e-3 * length for length in size), T, can_be_held=True)


def planned(stage: Stage, steps: str, *objects: SceneObject) -> tuple[Program, State]:
    start = replace(stage.begin(), objects=objects, poured=None)
    return stage.planned(f"frame: base\nsteps:\n{steps}", start), start


def played(stage: Stage, steps: str, *objects: SceneObject) -> dict[str, SceneObject]:
    """Run the steps; return the objects at the end by their names."""
    program, start = planned(stage, steps, *objects)
    run, states = stage.play(program, start, period=PREVIEW_TICK)
    assert run.phase is Phase.DONE
    assert all(not state.findings for state in states[::10])
    return {scene_object.name: scene_object for scene_object in states[-1].objects}


def place(scene_object: SceneObject) -> list[float]:
    """Return x, y, z [mm] of an object, which must stand upright and free."""
    assert not scene_object.held
    assert scene_object.T[2, 2] == pytest.approx(1.0, abs=1e-5)
    x, y, z = (1e3 * scene_object.T[:3, 3]).tolist()
    return [x, y, z]


@pytest.mark.long
def test_three_boxes_are_stacked(stage: Stage) -> None:
    steps = "- stack: {object: b, on: a}\n- stack: {object: c, on: b}\n- home\n"
    end = played(
        stage,
        steps,
        box("a", (240.0, -100.0), (50.0, 50.0, 40.0)),
        box("b", (240.0, 60.0), (40.0, 40.0, 50.0), yaw=13.0),
        box("c", (120.0, 220.0), (40.0, 40.0, 50.0), yaw=45.0),
    )
    assert [place(end[name])[2] for name in "abc"] == pytest.approx([0.0, 40.0, 90.0], abs=0.05)
    assert place(end["c"])[:2] == pytest.approx([240.0, -100.0], abs=0.05)


def test_stacked_object_is_grasped_so_that_it_can_be_placed(stage: Stage) -> None:
    """From above, which is tried first, the arm does not reach the other object."""
    objects = box("a", (360.0, -100.0), (50.0, 50.0, 40.0)), box("b", (290.0, 0.0))
    with pytest.raises(ScriptError, match=r"b cannot be placed there: .* a pitch of 90"):
        planned(stage, "- stack: {object: b, on: a, pitch: 90}\n", *objects)
    planned(stage, "- stack: {object: b, on: a}\n", *objects)


def test_plan_knows_where_it_puts_an_object(stage: Stage) -> None:
    """A later step stacks another object there."""
    plan = PlanState(
        stage.plan_context,
        replace(stage.begin(), objects=(box("b", NEAR, LOW),), poured=None),
    )
    (b,) = (
        PlaceHeld(Spot(*(1e-3 * length for length in AT)), in_base=True)
        .build(Pick("b").build(plan))
        .state.objects
    )
    assert place(b) == pytest.approx([*AT, 0.0], abs=0.2)


def test_released_object_stands_on_what_is_below_it(stage: Stage) -> None:
    steps = "- pick: b\n- line: {by: {z: -53}}\n- release\n"
    end = played(stage, steps, box("b", NEAR, LOW))
    # Its contact with the table gives way by some micrometres.
    assert place(end["b"]) == pytest.approx([*NEAR, 0.0], abs=0.05)


OBJECTS = (
    box("part", NEAR, yaw=60.0),
    box("low", (170.0, 190.0), (40.0, 40.0, 10.0)),
    box("far", (550.0, -100.0)),
    replace(box("basin", (60.0, -200.0), (60.0, 70.0), shape=Shape.CYLINDER), can_be_held=False),
    replace(box("ball", (100.0, -250.0), (20.0,), shape=Shape.SPHERE), can_be_held=False),
)


@pytest.fixture(scope="module")
def holding(stage: Stage) -> State:
    """The hand holds `part` over its place."""
    program, start = planned(stage, "- pick: part\n", *OBJECTS)
    return stage.play(program, start, period=PREVIEW_TICK)[1][-1]


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ("- pick: box\n", "no object 'box'. Known objects: 'part', 'low', 'far'"),
        ("- pick: low\n", "low is 10.0 mm high, and the minimum is 12 mm"),
        ("- pick: far\n", r"far cannot be grasped at its place: The tool grasp cannot be at"),
        ("- place: {at: {x: 230, y: -120}}\n", "The hand holds nothing to `place`. `pick` an"),
        ("- release\n", "The hand holds nothing to `release`"),
        ("- pick: {object: part, side: front}\n", "its sides are turned too far, seen from"),
        # The pitch of the grasp has nothing to do with it.
        (
            "- pick: part\n- place: {at: {x: 230, y: 720}}\n",
            "nothing carries it there.*choose a place on it.$",
        ),
    ],
)
def test_what_cannot_be_done_is_refused_with_its_reason(
    stage: Stage, steps: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        planned(stage, steps, *OBJECTS)


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ("- pick: low\n", "already holds an object"),
        ("- stack: {object: low, on: far}\n", "already holds an object"),
        ("- release\n", "part would fall 60 mm"),
        ("- gripper: open\n", "part would fall 60 mm. Lower it to at most 10 mm"),
        (
            "- place: {at: {x: 100, y: -40}}\n",
            r"placed there: The path .* at \(99.9, -39.8, \d+.\d\) mm in the base frame",
        ),
        ("- place: {on: basin}\n", "basin is open at its top and cannot carry part"),
        ("- place: {at: {x: 60, y: -200}}\n", "basin is open at its top and cannot carry part"),
        ("- place: {at: {x: 230, y: -120, z: 30}}\n", "put it 30.0 mm lower"),
        ("- place: {on: ball}\n", "ball cannot carry part"),
        ("- place: {on: far, at: {x: 230, y: -120}}\n", "far cannot carry part"),
        ("- place: {at: {x: 180, y: 150}}\n", "cannot be placed there: .*low"),
    ],
)
def test_what_cannot_be_done_with_a_held_object_is_refused(
    stage: Stage, holding: State, steps: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        stage.planned(f"frame: base\nsteps:\n{steps}", holding)


def test_fingers_without_room_to_open_are_refused(stage: Stage) -> None:
    """A run would wait for fingers that press against what stands fast."""
    post = replace(box("post", (-40.0, -240.0), (10.0, 60.0, 60.0)), can_be_held=False)
    steps = (
        "- tool: grasp\n- gripper: closed\n- move: {x: 0, y: -240, z: 50, pitch: 90, roll: 0}\n"
        "- gripper: open\n"
    )
    with pytest.raises(InputError, match=r"finger would meet post\. Leave more room beside"):
        planned(stage, steps, post)


@pytest.mark.long
@pytest.mark.parametrize(
    ("side", "size"),
    [("above", (40.0, 40.0, 12.0)), ("front", (40.0, 40.0, 12.0))],
)
def test_low_object_is_held_by_the_fingertips(
    stage: Stage, side: str, size: tuple[float, ...]
) -> None:
    """The tips keep their distance from the table, and cover a part of the object's sides."""
    origin, to = (NEAR, AT) if side == "above" else ((340.0, 0.0), (300.0, -120.0))
    steps = (
        f"- pick: {{object: plate, side: {side}}}\n- place: {{at: {{x: {to[0]}, y: {to[1]}}}}}\n"
    )
    program, start = planned(stage, steps, box("plate", origin, size))
    run, states = stage.play(program, start)
    assert run.phase is Phase.DONE
    assert not any(state.findings for state in states)
    assert place(states[-1].objects[0]) == pytest.approx([*to, 0.0], abs=0.2)
    held = next(state for state in states if state.grip is not None)
    world, hand = stage.session.world_at(held), stage.session.environment.hand
    assert world is not None
    assert hand is not None
    for finger in hand.fingers:
        assert MARGIN <= world.gap(held.x_setpoint, finger, "table") <= 1e-3 * (size[2] - 4.0)


def summary(task: Task) -> tuple[str, float]:
    """Return what a task does, and how long its path takes [s]."""
    plan = task.action.plan if isinstance(task.action, FollowPlan) else None
    return type(task.action).__name__, 0.0 if plan is None else round(plan.duration, 9)


@pytest.mark.cases(1)
@pytest.mark.parametrize("command", [cmd.Stop(), cmd.Pause()])
def test_program_is_planned_for_a_stopped_arm_as_for_a_free_one(
    stage: Stage, command: cmd.Command
) -> None:
    steps = "- grasp: part\n- line: {by: {z: 40}}\n- set_down:\n"
    free, start = planned(stage, steps, box("part", NEAR))
    halted = stage.session.step(start, [command], start.t + TICK)
    assert halted.stopped is not None or halted.paused
    program = stage.planned(f"frame: base\nsteps:\n{steps}", halted)
    assert list(map(summary, program.tasks)) == list(map(summary, free.tasks))


@pytest.mark.cases(1)
@pytest.mark.parametrize("checked", [False, True])
def test_run_fails_if_the_fingers_close_on_nothing(stage: Stage, checked: bool) -> None:
    """Somebody takes the object away while the arm approaches it."""
    steps = "- grasp: part\n" + "- if: {held: part, then: [home]}\n" * checked
    program, state = planned(stage, steps, box("part", NEAR))
    away = box("part", (-200.0, 250.0))
    run, last = Run(state.t), ""
    while run.phase is Phase.RUNNING and state.t < 60.0:
        name = program.tasks[run.number].name
        run, commands = runner.step(program, run, state, state.t)
        if name != last == "grasp part":
            commands = (cmd.PlaceObject(away), *commands)
        last = name
        state = stage.session.step(state, commands, state.t + TICK)
        state = stage.session.observe(state, state.setpoint, state.gripper_setpoint)
    if checked:
        assert (run.phase, run.choices) == (Phase.DONE, ((1, False),))
        return
    assert run.phase is Phase.FAILED
    assert run.why.startswith("Line 3, grasp part: close: The fingers have closed on nothing")
    assert "instead of part, which is not where it was when the script was planned" in run.why
    assert not state.moving


def test_object_held_from_the_front_is_not_turned(stage: Stage) -> None:
    steps = "- pick: {object: part, pitch: 65}\n- place: {at: {x: 300, y: -120, yaw: 45}}\n"
    with pytest.raises(ScriptError, match=r"its yaw would be .* Pick it with `side: above`"):
        planned(stage, steps, box("part", (320.0, 0.0)))


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("place: {}", "`place` needs `at` or `on`"),
        ("place: {on: a, at: {x: 1, y: 2, z: 3}}", "either `on` or the height z"),
        ("place: {at: {x: 1}}", "The place of an object needs 'y'"),
        ("place: a", "`place` must be a mapping"),
        ("stack: {object: a, on: a}", "a cannot stand on itself"),
        ("stack: {object: a}", "`stack` needs 'on'"),
        ("pick: {object: a, side: left}", "Expected one of `front`, `above`"),
        ("release: a", "`release` takes no value"),
    ],
)
def test_mistakes_are_reported_with_their_place(step: str, message: str) -> None:
    with pytest.raises(ScriptError, match=rf"line 2, column \d+: .*{message}"):
        parse(f"steps:\n- {step}\n")


def test_cup_is_poured_only_if_held_from_the_front(stage: Stage) -> None:
    text = "frame: base\nsteps:\n- pick: {object: cup, side: above}\n"
    with pytest.raises(ScriptError, match="from above the wrist could not pour it"):
        stage.planned(text)
