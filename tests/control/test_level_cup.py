"""A level cup typed with yaw 0 in the live session; tests/kinematics/test_level_cup.py has more."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.findings import of_projection
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import Reason
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import project

LEVEL = 1e-6
"""[rad] Tolerance of a level cup."""


def tilt(session: Session, q: FloatArray) -> float:
    """Return the angle [rad] between the tool's z axis and the vertical at ``q`` (5,) [rad]."""
    T = forward(session.require_arm().chain, q)
    return math.atan2(math.hypot(T[0, 2], T[1, 2]), T[2, 2])


def test_pitch_kept_in_the_goal_is_kept_on_arrival(session: Session) -> None:
    azimuth = math.radians(-160.0)
    place = np.array((0.3 * math.cos(azimuth), 0.3 * math.sin(azimuth), 0.25))
    T = se3.from_rotation_translation(np.eye(3), place)
    state = session.begin(session.ready, 0.0, 0.0)
    state = session.step(state, (cmd.SetPriority(Priority.PITCH), cmd.Pose(T)), 0.01)
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
    findings = of_projection(chain, p, Priority.PITCH, yaw_was_given=True)
    amounts = {finding.reason: finding.amount for finding in findings}
    assert amounts[Reason.OUT_OF_REACH] == p.position_error
    assert amounts[Reason.PITCH_CHANGED] == p.pitch_error
    assert all(finding_text(finding) for finding in findings)
