"""Water in a cup that the arm holds: it is carried and poured, and its volume is conserved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import Attachment, SceneObject
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import ML, counted
from tests.ticks import ticked

FULL = counted(200.0 * ML)


@pytest.fixture(scope="module")
def session(shipped: Session) -> Session:
    return shipped


@pytest.fixture
def full(session: Session) -> State:
    return ticked(session, session.begin(session.ready, 0.0, 0.0), cmd.Fill(200.0))


def held_level(session: Session, state: State) -> State:
    """Return ``full`` with the cup fixed to the hand, upright at the grasp frame."""
    x = np.append(state.setpoint, state.gripper_setpoint)
    palm = session.environment.pose(replace(state.objects[0], T=np.eye(4), held=True), x)
    (cup,) = (prop for prop in state.objects if prop.name == "cup")
    T = se3.from_rotation_translation(np.eye(3), palm[:3, 3] + [0.1, 0.0, 0.0])
    held = session.environment.mounted(replace(cup, T=T), Attachment.HAND, x)
    objects: tuple[SceneObject, ...] = tuple(
        held if prop is cup else prop for prop in state.objects
    )
    return ticked(session, replace(state, objects=objects), cmd.Fill(200.0))


def test_water_at_rest_keeps_its_value(session: Session, full: State) -> None:
    assert full.poured is not None
    assert full.poured.water.cup.volume == FULL
    assert ticked(session, full, ticks=3).poured is full.poured


def test_moved_cup_keeps_its_water(session: Session, full: State) -> None:
    (cup,) = (prop for prop in full.objects if prop.name == "cup")
    T: FloatArray = se3.from_rotation_translation(np.eye(3), (0.3, 0.1, 0.0))
    moved = ticked(session, full, cmd.PlaceObject(replace(cup, T=T)), ticks=50)
    assert moved.poured is not None
    assert moved.poured.water.cup.volume == FULL
    np.testing.assert_array_equal(moved.poured.water.cup.T, T)
    assert moved.poured.still


def test_overturned_cup_loses_all_its_water_and_volume_is_conserved(
    session: Session, full: State
) -> None:
    state = held_level(session, full)
    state = ticked(session, state, cmd.Joint(5, 2.6), ticks=600)
    assert state.poured is not None
    water = state.poured.water
    assert water.total == FULL
    assert water.cup.volume < 2 * 10**12
    assert water.spilled + water.basin > 197 * 10**12


def test_stop_during_a_pour_leaves_the_water_that_the_tilt_holds(
    session: Session, full: State
) -> None:
    state = held_level(session, full)
    state = ticked(session, state, cmd.Speed(0.2), cmd.Joint(5, 2.6))
    while state.poured is not None and state.poured.water.cup.volume > 0.8 * FULL:
        assert state.moving
        state = ticked(session, state)
    state = ticked(session, state, cmd.Stop(), ticks=500)
    assert state.stopped is not None
    assert state.poured is not None
    assert state.poured.water.cup.volume > 0
    assert state.poured.water.total == FULL
    assert not state.poured.water.parcels
    later = ticked(session, state, ticks=100)
    assert later.poured is not None
    assert later.poured.water.cup.volume == state.poured.water.cup.volume


def test_volume_above_the_capacity_is_refused(session: Session) -> None:
    for volume in (300.0, -1.0):
        with pytest.raises(InputError, match="cannot hold"):
            session.check(cmd.Fill(volume))
    with pytest.raises(InputError):
        cmd.Fill(np.nan)


def test_fill_without_a_cup_is_refused(session: Session, full: State) -> None:
    removed = ticked(session, full, cmd.Remove("cup"), ticks=2)
    assert removed.poured is None
    assert ticked(session, removed, cmd.Fill(100.0)).poured is None


def swing(session: Session, state: State, steps: tuple[float, ...]) -> tuple[float, float]:
    """Return the peak acceleration [m/s^2] and the peak jerk [m/s^3] of the cup in a swing."""
    commands: tuple[cmd.Command, ...] = (cmd.Joint(1, 0.8),)
    peak, end, number = 0.0, state.t + 1.0, 0
    while state.t < end:
        state = session.step(state, commands, state.t + steps[number % len(steps)])
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
        assert state.poured is not None
        peak = max(peak, float(np.linalg.norm(state.poured.course.acceleration or 0.0)))
        commands, number = (), number + 1
    assert state.poured is not None
    return peak, state.poured.course.peak_jerk


def test_unequal_ticks_do_not_shake_the_water(session: Session, full: State) -> None:
    """A tick for a STOP divides a period in two unequal parts."""
    held = held_level(session, full)
    acceleration, jerk = swing(session, held, (0.01,))
    unequal = swing(session, held, (0.0005, 0.0095, 0.01))
    assert unequal == pytest.approx((acceleration, jerk), rel=0.02)
