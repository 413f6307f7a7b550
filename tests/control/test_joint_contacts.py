"""Robots that are driven joint by joint brake before their own contacts, as an arm does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.arm import JointSet
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.scene_objects import Attachment
from katana450.arm.control.state.state import Reason, State, Status
from katana450.arm.robot.loader import load
from katana450.errors import InputError
from katana450.extensions.bodies.robot_world import robot_world
from katana450.maths.collision.clearance import DISTANCE_ROUNDING, MIN_CLEARANCE
from katana450.maths.collision.world import CollisionWorld
from tests.conftest import LONG
from tests.robot.hands import column, hand, rail
from tests.robot.on_the_table import block
from tests.ticks import during

DT = 0.01


class Made(NamedTuple):
    """A robot that is driven joint by joint."""

    session: Session
    world: CollisionWorld
    joints: JointSet

    def move(self, **values: float) -> cmd.SetAxes:
        """Return the command that moves the named joints [rad or m]."""
        return cmd.SetAxes(tuple((self.joints.names.index(n) + 1, q) for n, q in values.items()))


Make = Callable[[str], Made]


@pytest.fixture(scope="module")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return a function that makes the session and the world of a robot from its URDF."""
    path = tmp_path_factory.mktemp("robot") / "robot.urdf"

    @cache
    def made(text: str) -> Made:
        path.write_text(text)
        robot = load(path)
        world, _, _ = robot_world(robot)
        assert world is not None
        joints = robot.joint_group
        session = Session(joints, joints.ready, world, travel=robot.distance)
        return Made(session, world, joints)

    return made


def begun(session: Session) -> State:
    return session.begin(session.ready, 0.0, 0.0)


def excess(world: CollisionWorld, state: State) -> float:
    """Return the smallest distance of any pair beyond what it keeps [m]."""
    placed, checked = world.at(state.x_setpoint), world.kept(MIN_CLEARANCE)
    return float(min(placed.distance(pair) - checked[pair] for pair in range(len(checked))))


def test_carriages_on_one_rail_stop_before_each_other(make: Make) -> None:
    machine = make(rail())
    session, world = machine.session, machine.world
    state = during(session, begun(session), 4.0, machine.move(slide_left=0.4))[-1]
    # 0.2 m apart, 50 mm wide, and 5 mm stay between them.
    assert state.setpoint[0] == pytest.approx(0.144, abs=1.5e-3)
    assert world.gap(state.x_setpoint, "left", "right") >= MIN_CLEARANCE - DISTANCE_ROUNDING
    assert (state.status, state.moving, state.goal[0]) == (Status.BLOCKED, False, 0.4)
    (finding,) = state.findings
    assert (finding.reason, set(finding.parts or ())) == (Reason.CONTACT, {"left", "right"})
    assert finding.amount == pytest.approx(MIN_CLEARANCE, abs=3e-3)
    assert sentence(state).startswith("Left and right are ")


def test_both_carriages_brake_and_the_blocked_one_continues_once_free(make: Make) -> None:
    machine = make(rail())
    session, world = machine.session, machine.world
    command = machine.move(slide_left=0.4, slide_right=-0.3)
    states = during(session, begun(session), 3.0, command)
    assert min(excess(world, state) for state in states) >= -DISTANCE_ROUNDING
    assert states[-1].blocked
    state = during(session, states[-1], 4.0, machine.move(slide_right=0.3))[-1]
    np.testing.assert_allclose(state.setpoint, (0.4, 0.3), atol=1e-9)
    assert (state.status, state.findings) == (Status.OK, ())


def test_a_stream_is_followed_up_to_the_contact_and_not_into_it(make: Make) -> None:
    machine = make(rail())
    session, world = machine.session, machine.world
    state = begun(session)
    for number in range(200):
        t = state.t + DT
        sample = cmd.Servo(np.array((min(0.3, 0.004 * number), 0.0))).timed(t)
        state = session.step(state, (sample,), t)
        state = session.observe(state, state.setpoint, 0.0)
        assert excess(world, state) >= -DISTANCE_ROUNDING
    assert state.blocked
    assert 0.135 < state.setpoint[0] < 0.1451


def test_stop_and_pause_work_before_a_contact(make: Make) -> None:
    machine = make(rail())
    session, world = machine.session, machine.world
    state = during(session, begun(session), 0.4, machine.move(slide_left=0.4))[-1]
    assert state.moving
    stopped = during(session, state, 2.0, cmd.Stop())[-1]
    assert stopped.status is Status.STOPPED
    assert excess(world, stopped) >= 0.0
    paused = during(session, state, 2.0, cmd.Pause())[-1]
    assert (paused.status, paused.moving) == (Status.PAUSED, False)


def test_joints_that_brake_on_a_curve_keep_the_clearance_between_its_samples(make: Make) -> None:
    # Two fingers that spread and bend pass each other while each joint brakes by itself.
    machine = make(hand())
    session, world = machine.session, machine.world
    command = machine.move(
        finger2_spread=0.35, finger2_bend1=1.6, finger2_bend2=1.5, finger1_bend2=1.0
    )
    states = during(session, begun(session), 0.5, command)
    assert any(state.blocked for state in states)
    assert min(excess(world, state) for state in states) >= -DISTANCE_ROUNDING


targets = st.lists(
    st.tuples(st.lists(st.floats(-1.7, 1.7), min_size=16, max_size=16), st.floats(0.05, 0.5)),
    min_size=1,
    max_size=3,
)


@settings(max_examples=8 if LONG else 4)
@given(targets)
def test_no_motion_of_a_hand_brings_its_parts_too_near(
    make: Make, wanted: Sequence[tuple[Sequence[float], float]]
) -> None:
    machine = make(hand())
    session, world = machine.session, machine.world
    state = begun(session)
    for q, seconds in wanted:
        goal = machine.joints.clamp(np.array(q))
        states = during(session, state, seconds, cmd.Joints(goal))
        assert min(excess(world, state) for state in states) >= -DISTANCE_ROUNDING
        state = states[-1]
    stopping = during(session, state, 0.5, cmd.Stop())
    assert min(excess(world, state) for state in stopping) >= -DISTANCE_ROUNDING


def test_fingers_that_stand_closer_than_5_mm_keep_half_of_their_distance(make: Make) -> None:
    # 27 mm apart and 24 mm wide: 3 mm between them at rest.
    machine = make(hand(3, pitch=0.027, thumb=False))
    session, world = machine.session, machine.world
    assert min(world.close.values()) == pytest.approx(1.5e-3, abs=1e-6)
    command = machine.move(finger1_spread=0.3)
    state = during(session, begun(session), 1.2, command)[-1]
    free = world.gap(state.x_setpoint, "finger1_link1", "finger2_link1")
    state = during(session, state, 1.2, machine.move(finger1_spread=-0.3))[-1]
    near = world.gap(state.x_setpoint, "finger1_link3", "finger2_link3")
    assert min(free, near) >= 1.5e-3 - DISTANCE_ROUNDING
    assert state.blocked
    assert sentence(state).endswith("mm apart: they must not come nearer.")
    # Each finger alone bends past its neighbours.
    bent = during(session, begun(session), 2.0, machine.move(finger2_bend1=1.4))[-1]
    assert bent.setpoint[machine.joints.names.index("finger2_bend1")] == 1.4


def test_a_robot_that_begins_in_a_contact_can_leave_it(make: Make) -> None:
    machine = make(rail())
    session, world = machine.session, machine.world
    state = session.begin(np.array((0.149, 0.0)), 0.0, 0.0)
    assert world.gap(state.x_setpoint, "left", "right") < MIN_CLEARANCE
    nearer = during(session, state, 1.0, machine.move(slide_left=0.2))[-1]
    assert nearer.setpoint[0] == 0.149
    assert nearer.blocked
    away = during(session, replace(state, blocked=False), 2.0, machine.move(slide_left=0.0))[-1]
    assert away.setpoint[0] == 0.0


def height(state: State) -> float:
    """Return the height of the underside of the beam of a column over its foot [m]."""
    return float(state.setpoint[0]) + 0.35 - 0.02


@pytest.mark.parametrize("foot", [0.0, -0.3])
def test_a_beam_stops_before_the_table(make: Make, foot: float) -> None:
    machine = make(column(foot))
    states = during(machine.session, begun(machine.session), 4.0, machine.move(lift=-0.4))
    state = states[-1]
    assert min(map(height, states)) >= MIN_CLEARANCE - DISTANCE_ROUNDING
    assert height(state) == pytest.approx(MIN_CLEARANCE, abs=1.5e-3)
    (finding,) = state.findings
    assert (finding.reason, set(finding.parts or ())) == (Reason.CONTACT, {"beam", "table"})
    assert sentence(state).startswith("Beam and table are ")


def test_an_object_is_an_obstacle_until_it_is_removed(make: Make) -> None:
    machine = make(column(-0.3))
    session = machine.session
    state = during(session, begun(session), 0.05, cmd.PlaceObject(block(-0.3)))[-1]
    states = during(session, state, 4.0, machine.move(lift=-0.4))
    state = states[-1]
    assert min(map(height, states)) >= 0.1 + MIN_CLEARANCE - DISTANCE_ROUNDING
    assert height(state) == pytest.approx(0.1 + MIN_CLEARANCE, abs=3e-3)
    assert (state.status, state.findings[0].parts) == (Status.BLOCKED, ("beam", "block"))
    # The goal stays, so the beam continues down to the table once the object is away.
    state = during(session, state, 3.0, cmd.Remove("block"))[-1]
    assert height(state) == pytest.approx(MIN_CLEARANCE, abs=3e-3)
    assert state.findings[0].parts == ("beam", "table")


def test_commands_about_a_hand_or_water_are_refused(make: Make) -> None:
    session = make(column()).session
    held = replace(block(), fixed=True)
    for command in (cmd.Attach("block", Attachment.HAND), cmd.PlaceObject(held)):
        with pytest.raises(InputError, match="Nothing can be fixed to a hand: there is no arm"):
            session.check(command)
    with pytest.raises(InputError, match="There is no cup to fill"):
        session.check(cmd.Fill(10.0))
    with pytest.raises(InputError, match="There is no cup to fill"):
        session.check(cmd.Batch((cmd.ReplaceScene((block(),), 1e-5),)))
    with pytest.raises(InputError, match="Only its joints can be driven"):
        session.check(cmd.Tool("tcp"))
