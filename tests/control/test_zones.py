"""Keep-out zones: the arm and what it carries keep clear of them, all else passes through."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import obstacle_of
from katana450.arm.control.session.plans import plan_along
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.slow_zones import SLOW_SPEED
from katana450.arm.control.state.scene_objects import SceneObject, Shape, Zone
from katana450.arm.control.state.state import Reason, State, Status
from katana450.errors import InputError
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import se3
from katana450.maths.planning.joint_path import JointPath
from tests.ticks import TICK, settled, states, until_rest

LOW = np.radians((30.0, -40.0, 95.0, -20.0, 0.0))
"""[rad] A posture from which axis 1 turns the hand towards x = 0.4 m, y = 0."""

ZONE = SceneObject(
    "door",
    Shape.BOX,
    (0.2, 0.1, 0.5),
    se3.from_rotation_translation(np.eye(3), (0.4, -0.1, 0.02)),
    zone=Zone.KEEP_OUT,
)


@pytest.fixture(scope="module")
def session(shipped: Session) -> Session:
    return shipped


def begun(session: Session, *objects: SceneObject) -> State:
    state = session.begin(LOW, 0.0, 0.0)
    return session.step(state, [cmd.ReplaceScene(objects)], TICK)


def test_arm_stops_before_a_zone_and_names_it(session: Session) -> None:
    (*_, end) = until_rest(session, begun(session, ZONE), cmd.Joint(1, -0.6))
    (finding,) = end.findings
    assert finding.reason is Reason.CONTACT
    assert "door" in (finding.parts or ())
    assert MIN_CLEARANCE <= finding.amount < 2.0 * MIN_CLEARANCE
    free = until_rest(session, begun(session), cmd.Joint(1, -0.6))[-1]
    assert free.findings == ()


def test_what_the_hand_carries_keeps_out_too(session: Session) -> None:
    rod = SceneObject("rod", Shape.BOX, (0.3, 0.3, 0.02), np.eye(4), fixed=True)
    alone = until_rest(session, begun(session, ZONE), cmd.Joint(1, -0.6))[-1]
    (*_, end) = until_rest(session, begun(session, ZONE, rod), cmd.Joint(1, -0.6))
    assert end.findings[0].parts is not None
    assert set(end.findings[0].parts) == {"rod", "door"}
    assert end.setpoint[0] > alone.setpoint[0]


def test_objects_fall_through_a_zone(session: Session) -> None:
    above = se3.from_rotation_translation(np.eye(3), (0.4, -0.1, 0.3))
    box = SceneObject("box", Shape.BOX, (0.04, 0.04, 0.04), above, can_be_held=True)
    state = begun(session, ZONE)
    state = session.step(state, [cmd.PlaceObject(box)], state.t + TICK)
    (zone, fallen) = settled(session, state).objects
    assert zone.T.tolist() == ZONE.T.tolist()
    assert fallen.T[2, 3] == pytest.approx(0.0, abs=1e-4)


def test_arm_stays_on_its_side_of_a_plane_that_is_drawn_elsewhere(session: Session) -> None:
    R = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
    T = se3.from_rotation_translation(R, (-1.0, -0.15, 1.0))
    plane = SceneObject("wall", Shape.PLANE, (0.1, 0.1), T, zone=Zone.KEEP_OUT)
    (*_, end) = until_rest(session, begun(session, plane), cmd.Joint(1, -0.6))
    (finding,) = end.findings
    assert "wall" in (finding.parts or ())
    assert MIN_CLEARANCE <= finding.amount < 2.0 * MIN_CLEARANCE
    with pytest.raises(InputError, match="'wall' is a plane, so it must be a zone"):
        replace(plane, zone=Zone.NONE)


@pytest.mark.parametrize(
    "change", [{"can_be_held": True}, {"held": True}, {"fixed": True},
               {"shape": Shape.VESSEL, "size": (0.05, 0.1)}]
)  # fmt: skip
def test_a_zone_is_nothing_else(change: dict[str, object]) -> None:
    with pytest.raises(InputError, match="'door' is a zone"):
        replace(ZONE, **change)  # type: ignore[arg-type]


def test_the_water_s_vessels_cannot_be_zones(session: Session) -> None:
    for name in ("cup", "basin"):
        with pytest.raises(InputError, match=f"The {name} cannot be a zone"):
            session.check(cmd.PlaceObject(replace(ZONE, name=name)))


SLOW = replace(ZONE, name="people", zone=Zone.SLOW)


def speed_of(session: Session, state: State) -> float:
    """Return the speed of the tool point [m/s]."""
    arm = session.require_arm()
    return arm.kinematics_to(state.tool).tool_speed(state.setpoint, state.motion.qd)


@cache
def with_zone(session: Session) -> CollisionWorld:
    """Return the world of the arm with the zone as an obstacle."""
    assert session.world is not None
    return session.world.with_obstacles([obstacle_of(SLOW)])


def is_inside(session: Session, state: State) -> bool:
    """Return whether a part of the arm overlaps the zone."""
    placed = with_zone(session).at(state.x_setpoint)
    contacts = [placed.contact(pair) for pair in placed.nearer_than(0.0)[0].tolist()]
    return any("people" in contact.parts and contact.distance < 0.0 for contact in contacts)


def passage(session: Session, command: cmd.Command) -> float:
    """Let the arm move through the zone and out of it; check its speed and its findings.

    Return the time [s] that it takes.
    """
    state = begun(session, SLOW)
    ticks = until_rest(session, state, cmd.Speed(1.0), command)
    inside = [passed for passed in ticks if is_inside(session, passed)]
    assert len(inside) > 20
    assert max(speed_of(session, passed) for passed in inside) <= SLOW_SPEED + 1e-9
    for passed in inside:
        (finding,) = passed.findings
        assert finding.reason is Reason.SLOW_ZONE
        assert (finding.parts or ("", ""))[1] == "people"
        assert passed.status is Status.OK
    assert max(speed_of(session, passed) for passed in ticks) > 1.2 * SLOW_SPEED
    assert ticks[-1].findings == ()
    assert ticks[-1].speed == 1.0
    return ticks[-1].t - state.t


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "command", [cmd.Joint(1, -1.2), cmd.Joints(LOW - (1.4, 0.0, 0.0, 0.0, 0.0))]
)
def test_the_tool_is_slow_in_a_zone(session: Session, command: cmd.Command) -> None:
    passage(session, command)


def test_a_plan_is_slow_in_a_zone_and_says_its_time(session: Session) -> None:
    arm = session.require_arm()
    path = JointPath(arm.chain, np.array((LOW, LOW - (1.4, 0.0, 0.0, 0.0, 0.0))))
    slow, free = (
        plan_along(arm, session.world_at(state), state, [path])
        for state in (begun(session, SLOW), begun(session))
    )
    time = passage(session, cmd.Follow(slow))
    assert slow.duration == pytest.approx(time, rel=0.03)
    assert free.duration < 0.9 * time
    # At half of full speed no zone slows the arm.
    assert slow.duration_at(0.5) == pytest.approx(free.duration_at(0.5))


def test_what_the_hand_carries_is_slow_in_a_zone(session: Session) -> None:
    rod = SceneObject("rod", Shape.BOX, (0.3, 0.3, 0.02), np.eye(4), fixed=True)
    state = begun(session, SLOW, rod)
    parts = [
        finding.parts
        for passed in until_rest(session, state, cmd.Joint(1, -0.6))
        for finding in passed.findings
        if finding.reason is Reason.SLOW_ZONE
    ]
    assert parts[0] == ("rod", "people")


def test_a_jog_is_slow_in_a_zone(session: Session) -> None:
    state = begun(session, SLOW)
    jog = cmd.Jog(np.array((0.0, -0.4, 0.0, 0.0, 0.0)))
    passed = list(islice(states(session, state, jog, every=True), 180))
    inside = [state for state in passed if is_inside(session, state)]
    assert len(inside) > 20
    assert max(speed_of(session, state) for state in inside) <= SLOW_SPEED + 1e-9
    for state in inside:
        assert Reason.SLOW_ZONE in [finding.reason for finding in state.findings]
