"""Objects are grasped, carried and placed by arms of four, six and seven axes."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import viser

from katana450.arm.control.state.state import State
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run.simulation import Planned, plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.server.preview import PreviewNodes
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from tests.general_arms.gripping_arms import gripping_urdf
from tests.programs.test_pick_place import place
from tests.viser_bridge import internals

TICK = 0.01


class Bench(NamedTuple):
    """Places on the table that an arm reaches [mm], and a box that its fingers take."""

    near: tuple[float, float]
    to: tuple[float, float]
    box: tuple[float, float, float]


BENCHES = {
    "Panda": Bench((500.0, 100.0), (400.0, -200.0), (40.0, 50.0, 60.0)),
    "UR5e": Bench((500.0, 100.0), (400.0, -200.0), (40.0, 50.0, 60.0)),
    "OpenMANIPULATOR-X": Bench((200.0, 60.0), (160.0, -120.0), (25.0, 25.0, 50.0)),
    "KR 6": Bench((600.0, 150.0), (550.0, -250.0), (40.0, 50.0, 60.0)),
}


def item(
    name: str,
    shape: str,
    size: tuple[float, ...],
    place: tuple[float, float],
    yaw: float = 0.0,
    *,
    can_be_held: bool = True,
) -> str:
    """Return an object of a scene in a script; lengths in mm, the yaw in deg."""
    held = str(can_be_held).lower()
    return (
        f"{{name: {name}, shape: {shape}, size: {list(size)}, "
        f"pose: [{place[0]}, {place[1]}, 0, 0, 0, {yaw}], can_be_held: {held}}}"
    )


def planned(tmp_path: Path, urdf: str, steps: list[str], *items: str) -> Planned:
    """Return the steps, planned in a scene of the objects."""
    path = tmp_path / "arm.urdf"
    path.write_text(urdf, encoding="utf-8")
    scene = "".join(f"  - {line}\n" for line in items)
    text = f"frame: base\nscene:\n{scene}steps:\n" + "".join(f"  - {line}\n" for line in steps)
    return plan_script(parse(text), path)


def played(plan: Planned) -> tuple[State, ...]:
    """Return the states of a run, in which nothing is found wrong."""
    states = run_by_clock(plan).states
    assert not any(state.findings for state in states)
    return states


def in_base(plan: Planned, state: State) -> FloatArray:
    """Return the pose (4, 4) of the object in the hand in the base frame."""
    assert state.held is not None
    return plan.session.environment.pose(state.held, state.x_setpoint)


def test_plan_of_seven_axes_carries_the_box_upright_to_its_place(tmp_path: Path) -> None:
    bench = BENCHES["Panda"]
    box = item("part", "box", bench.box, bench.near, 17.0)
    to = "place: {{at: {{x: {}, y: {}}}}}".format(*bench.to)
    plan = planned(tmp_path, gripping_urdf("Panda"), ["pick: part", to], box)
    arm, actions = plan.robot.require_arm(), (task.action for task in plan.program.tasks)
    paths = [action.plan.postures(40) for action in actions if isinstance(action, FollowPlan)]
    _, grasp, lift, *carry, _ = (arm.T_base_shoulder @ forward_batch(arm.chain, q) for q in paths)
    carried = np.concatenate((lift, *carry))
    np.testing.assert_allclose(carried[:, 2, :3] - grasp[-1, 2, :3], 0.0, atol=1e-5)
    way = 1e3 * (carried[-1] - grasp[-1])[:2, 3]
    assert way == pytest.approx(np.subtract(bench.to, bench.near), abs=0.5)


@pytest.mark.long
@pytest.mark.parametrize("name", BENCHES)
def test_box_is_picked_carried_upright_and_placed(name: str, tmp_path: Path) -> None:
    bench = BENCHES[name]
    box = item("part", "box", bench.box, bench.near, 17.0)
    to = "place: {{at: {{x: {}, y: {}}}}}".format(*bench.to)
    plan = planned(tmp_path, gripping_urdf(name), ["pick: part", to, "home"], box)
    states = played(plan)
    assert place(states[-1].objects[0]) == pytest.approx([*bench.to, 0.0], abs=0.5)
    np.testing.assert_allclose(states[-1].q, plan.session.ready, atol=1e-9)
    carried = [in_base(plan, state) for state in states if state.held is not None]
    assert len(carried) > 100
    assert min(T[2, 2] for T in carried) > 1.0 - 1e-5
    assert max(T[2, 3] for T in carried) > 0.07
    q = np.array([state.setpoint for state in states])
    limits = plan.session.require_arm().limits
    for order, most in enumerate((limits.speed, limits.acceleration, limits.jerk), start=1):
        assert (np.abs(np.diff(q, order, axis=0)) / TICK**order / most).max() <= 1.0 + 1e-6


def test_held_object_keeps_clear_of_a_wall_as_the_arm_does(tmp_path: Path) -> None:
    """The wall is so high that the hand alone would pass over it, but not the tall object.

    The hand closes upwards.
    """
    post = item("post", "box", (40.0, 40.0, 160.0), (480.0, 120.0), 14.0)
    wall = item("wall", "box", (300.0, 20.0, 150.0), (480.0, 0.0), can_be_held=False)
    steps = ["pick: {object: post, side: above}", "place: {at: {x: 480, y: -120}}"]
    plan = planned(tmp_path, gripping_urdf("UR5e", upside_down=True), steps, post, wall)
    gripper = plan.session.require_arm().gripper
    assert (gripper.closed, gripper.opened) == (0.0, -0.0425)
    states = played(plan)
    end = next(scene_object for scene_object in states[-1].objects if scene_object.name == "post")
    assert place(end) == pytest.approx([480.0, -120.0, 0.0], abs=0.5)
    carried = [state for state in states if state.held is not None]
    gaps = []
    for state in carried[::10]:
        world = plan.session.world_at(state)
        assert world is not None
        gaps.append(world.gap(state.x_setpoint, "post", "wall"))
    assert MIN_CLEARANCE < min(gaps) < 0.05
    places = [in_base(plan, state)[:3, 3] for state in carried]
    assert min(z for _, y, z in places if abs(y) < 0.01) > 0.15 + MIN_CLEARANCE


@pytest.mark.long
def test_both_fingers_may_be_driven(tmp_path: Path) -> None:
    box = item("part", "box", (40.0, 50.0, 60.0), (500.0, 100.0))
    steps = ["pick: part", "place: {at: {x: 400, y: -200}}"]
    states = played(planned(tmp_path, gripping_urdf("UR5e", mimic=False), steps, box))
    assert place(states[-1].objects[0]) == pytest.approx([400.0, -200.0, 0.0], abs=0.5)


def test_preview_shows_the_object_in_the_hand(server: viser.ViserServer, tmp_path: Path) -> None:
    bench = BENCHES["OpenMANIPULATOR-X"]
    box = item("part", "box", bench.box, bench.near, 17.0)
    plan = planned(tmp_path, gripping_urdf("OpenMANIPULATOR-X"), ["pick: part"], box)
    lifted = run_by_clock(plan).states[-50]
    preview = PreviewNodes(server, plan.robot, lambda: plan.session)
    preview.show(plan.program, plan.start)
    preview.look(lifted.t)
    for thread in [candidate for candidate in threading.enumerate() if candidate.name == "preview"]:
        thread.join(60.0)
    shown = preview._shown
    pose = None if shown is None else shown.at(lifted.t)
    assert pose is not None
    expected = in_base(plan, pose)[:3, 3]
    assert expected[2] > 0.02
    ghost = internals.nodes(server)["/path/objects/0"]
    assert ghost.visible
    np.testing.assert_allclose(ghost.position, expected, atol=1e-6)
