"""One jaw in the session, and grippers that close upwards in answers and exports."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import Reason, State
from katana450.arm.robot.collision import hand_of, world_of
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.extensions.hands.sides import with_sides
from katana450.extensions.programs.run.simulation import Planned, run_by_clock
from katana450.maths.geometry import se3
from katana450.server.service import serialize
from katana450.server.service.arm_handle import ArmHandle
from katana450.settings import Settings
from tests.general_arms.published_hands import (
    HOOK,
    RADIAL,
    ROBOTIQ_2F_85,
    hand_urdf,
    so101_urdf,
)
from tests.general_arms.test_grasping import item, planned
from tests.ticks import until_rest

CLOSED = cmd.Gripper(-0.174533)
BOX = (25.0, 20.0, 50.0)
"""[mm] Size of the part between the jaws of an SO-101."""


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Planned:
    """Return a grasp of an SO-101, planned."""
    part = item("part", "box", BOX, (220.0, -60.0), 17.0)
    return planned(tmp_path_factory.mktemp("arm"), so101_urdf(), ["grasp: part"], part)


@pytest.fixture(scope="module")
def before(plan: Planned) -> State:
    """Return the state in which the jaws are open beside the part."""
    opened = plan.session.require_arm().gripper.opened
    states = run_by_clock(plan).states
    last = max(n for n, state in enumerate(states) if state.gripper_setpoint == opened)
    return replace(states[last], mode=IDLE, goal=states[last].setpoint, outcomes=())


def gaps(session: Session, state: State, part: SceneObject) -> tuple[float, float]:
    """Return the distances [m] of both jaws from ``part``, which stands."""
    world = session.environment.world([part])
    assert world is not None
    one, other = (
        world.gap(state.x_setpoint, "part", name)
        for name in ("moving_jaw_so101_v1_link", "gripper_link")
    )
    return one, other


def test_one_jaw_pushes_the_part_and_takes_it_between_two_faces(
    plan: Planned, before: State
) -> None:
    states = until_rest(plan.session, before, CLOSED)
    assert states[-1].held is not None
    assert states[-1].status.value == "ok"
    first = next(n for n, state in enumerate(states) if state.held is not None)
    standing = [before, *states[:first]]
    away = np.array([gaps(plan.session, state, state.objects[0])[1] for state in standing])
    assert away[0] == pytest.approx(0.007, abs=1e-3)
    # It moves only towards the fixed jaw, in more than one tick.
    assert (np.diff(away) <= 5e-4).all()
    assert np.count_nonzero(np.diff(away) < -1e-4) > 5
    assert max(gaps(plan.session, states[first], standing[-1].objects[0])) <= 3e-4
    heights = [state.objects[0].T[2, 3] for state in standing]
    # The jaw tilts it a little.
    assert max(np.abs(heights)) < 3e-3


def test_stop_ends_the_push_and_the_part_stays(plan: Planned, before: State) -> None:
    start = before.objects[0].T
    states = until_rest(plan.session, before, CLOSED)
    under_way = next(
        state
        for state in states
        if state.held is None and np.linalg.norm(state.objects[0].T[:2, 3] - start[:2, 3]) > 1.5e-3
    )
    stopped = until_rest(plan.session, under_way, cmd.Stop())[-1]
    assert stopped.stopped is not None
    assert stopped.held is None
    # It has the speed of the jaw, 0.1 m/s, and slides on by 1 mm.
    ends = stopped.objects[0].T[:3, 3], under_way.objects[0].T[:3, 3]
    np.testing.assert_allclose(*ends, rtol=0, atol=3e-3)
    ignored = until_rest(plan.session, stopped, CLOSED)[-1]
    assert ignored.gripper_setpoint == stopped.gripper_setpoint
    ends = ignored.objects[0].T[:3, 3], stopped.objects[0].T[:3, 3]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-3)
    # A stop cannot be cleared at once.
    later = replace(stopped, t=stopped.t + 2.0)
    again = until_rest(plan.session, later, cmd.ClearStop())[-1]
    assert until_rest(plan.session, again, CLOSED)[-1].held is not None


def test_part_is_pushed_on_the_object_that_carries_it(plan: Planned, before: State) -> None:
    T = before.objects[0].T.copy()
    support = SceneObject("support", Shape.BOX, (0.02, 0.02, 0.02), T)
    T = T.copy()
    T[2, 3] = support.height
    stack = replace(before.objects[0], T=T), support
    closed = until_rest(plan.session, replace(before, objects=stack), CLOSED)[-1]
    assert closed.held is not None
    assert closed.held.name == "part"
    assert not closed.findings
    assert plan.session.environment.pose(closed.held, closed.x_setpoint)[2, 3] == pytest.approx(
        support.height, abs=3e-3
    )


def test_opened_jaw_leaves_the_part_standing(plan: Planned, before: State) -> None:
    held = until_rest(plan.session, before, CLOSED)[-1]
    assert held.grip is not None
    free = until_rest(plan.session, held, cmd.Gripper(1.7))[-1]
    assert free.held is None
    assert free.grip is None
    assert abs(free.objects[0].T[2, 3]) < 1e-3


def with_hand(folder: Path, hand: Any) -> DescribedRobot:
    """Return a UR5e with ``hand``, read from a file in ``folder``."""
    path = folder / "arm.urdf"
    path.write_text(hand_urdf("UR5e", hand), encoding="utf-8")
    return find_robot(Settings(), path, None)


@pytest.mark.parametrize(
    ("hand", "gripper", "slides"),
    [(ROBOTIQ_2F_85, (0.8, 0.0, 2.0), False), (RADIAL, (0.0, 0.04, 0.1), True)],
)
def test_answer_and_description_name_the_closed_end_first(
    tmp_path: Path, hand: Any, gripper: tuple[float, ...], slides: bool
) -> None:
    robot, session, _ = with_hand(tmp_path, hand)
    handle = cast("ArmHandle", SimpleNamespace(robot=robot, session=session))
    answer = serialize.arm(handle)
    assert (answer.gripper, answer.gripper_slides) == (gripper, slides)


def test_hand_that_is_not_understood_closes_at_the_lower_end(tmp_path: Path) -> None:
    robot, session, _ = with_hand(tmp_path, RADIAL)
    hand = session.environment.hand
    assert hand is not None
    assert hand.sides == (("digit_1",), ("digit_2",), ("digit_3",))
    assert robot.require_arm().gripper.closed == 0.0


def test_hand_with_one_moving_link_holds_nothing(tmp_path: Path) -> None:
    _, session, _ = with_hand(tmp_path, HOOK)
    hand = session.environment.hand
    assert hand is not None
    assert hand.sides == (("hook",),)
    start = session.begin(session.ready, 0.0, 0.0)
    (*_, opened) = until_rest(session, start, cmd.Gripper(0.12))
    palm = hand.T_palm_tool @ se3.from_rotation_translation(np.eye(3), (0.09, 0.0, -0.025))
    T = session.environment.pose(
        SceneObject("part", Shape.BOX, (0.02, 0.02, 0.05), palm, fixed=True), opened.x_setpoint
    )
    part = SceneObject("part", Shape.BOX, (0.02, 0.02, 0.05), T, can_be_held=True)
    (*_, closed) = until_rest(session, replace(opened, objects=(part,)), cmd.Gripper(0.05))
    assert closed.held is None
    assert closed.grip is None
    (contact,) = closed.findings
    assert contact.reason is Reason.CONTACT
    assert contact.parts == ("hook", "part")
    # It keeps the distance of all other parts.
    assert 0.005 <= contact.amount < 0.0052


def test_katana_has_the_sides_and_ends_of_its_file(robot: Robot) -> None:
    world, _ = world_of(robot)
    assert world is not None
    hand = hand_of(robot, world)
    complete = with_sides(world, hand)
    assert complete.gripper == hand.gripper
    assert complete.gripper.closed == hand.gripper.lower
    assert complete.fingers == hand.fingers == ("finger_right_link", "finger_left_link")
    assert complete.sides == hand.sides == (("finger_right_link",), ("finger_left_link",))
    assert complete.fixed_jaw == ()
