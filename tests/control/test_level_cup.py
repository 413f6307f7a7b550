"""A level cup typed with yaw 0 in the live session, from any posture that the arm may have."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.findings import of_projection
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import Reason, State
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import project

COUNT = 300

LEVEL = 1e-6
"""[rad] Tolerance of a level cup."""


def typed(session: Session, q: FloatArray, T: FloatArray) -> State:
    """Return the state just after ``T`` (4, 4) is typed with the arm at ``q`` (5,) [rad]."""
    state = session.begin(q, 0.0, 0.0)
    return session.step(state, (cmd.SetPriority(Priority.PITCH), cmd.Pose(T)), 0.01)


def tilt(session: Session, q: FloatArray) -> float:
    """Return the angle [rad] between the tool's z axis and the vertical at ``q`` (5,) [rad]."""
    T = forward(session.require_arm().chain, q)
    return math.atan2(math.hypot(T[0, 2], T[1, 2]), T[2, 2])


def test_typed_level_cup_stays_level_from_any_posture(session: Session) -> None:
    chain, rng = session.require_arm().chain, np.random.default_rng(5)
    gave_way = behind = 0
    for azimuth in np.linspace(-math.pi, math.pi, COUNT):
        radius, height = rng.uniform(0.1, 0.7), rng.uniform(-0.3, 0.5)
        place = np.array((radius * math.cos(azimuth), radius * math.sin(azimuth), height))
        start = rng.uniform(chain.lower, chain.upper)
        T = se3.from_rotation_translation(np.eye(3), place)
        state = typed(session, start, T)
        away = math.dist(forward(chain, state.goal)[:3, 3], place)
        reasons = {finding.reason: finding for finding in state.findings}
        if state.branch.shoulder == "front":  # type: ignore[union-attr]
            assert tilt(session, state.goal) <= LEVEL, (azimuth, radius, height, start)
            assert Reason.PITCH_CHANGED not in reasons
            assert (Reason.POSITION_CHANGED in reasons) == (away > 5e-5)
            gave_way += away > 5e-5
        else:
            # Bent over backwards, a level cup needs a roll of 180 deg, which axis 5 lacks.
            limit = math.pi - float(chain.upper[4])
            assert tilt(session, state.goal) <= limit + LEVEL
            assert abs(reasons[Reason.ROLL_CHANGED].amount - limit) < LEVEL
            behind += 1
    assert gave_way > 20
    assert behind > 20


def test_pitch_kept_in_the_goal_is_kept_on_arrival(session: Session) -> None:
    azimuth = math.radians(-160.0)
    place = np.array((0.3 * math.cos(azimuth), 0.3 * math.sin(azimuth), 0.25))
    T = se3.from_rotation_translation(np.eye(3), place)
    state = typed(session, session.ready, T)
    for _ in range(1000):
        state = session.observe(session.step(state, (), state.t + 0.01), state.setpoint, 0.0)
    assert not state.moving
    assert tilt(session, state.setpoint) <= LEVEL
    assert math.dist(forward(session.require_arm().chain, state.setpoint)[:3, 3], place) < 1e-6


def test_lost_pitch_is_reported_also_out_of_reach(session: Session) -> None:
    narrow = np.full(5, math.radians(20.0))
    chain = dataclasses.replace(session.require_arm().chain, lower=-narrow, upper=narrow)
    T = se3.from_rotation_translation(so3.rotation_y(math.pi / 2.0), np.array((1.0, 0.0, 0.0)))
    p = project(chain, T, priority=Priority.PITCH)
    assert p.pitch_error > 0.1
    found = of_projection(chain, p, Priority.PITCH, yaw_was_given=True)
    amounts = {each.reason: each.amount for each in found}
    assert amounts[Reason.OUT_OF_REACH] == p.position_error
    assert amounts[Reason.PITCH_CHANGED] == p.pitch_error
    assert all(finding_text(each) for each in found)
