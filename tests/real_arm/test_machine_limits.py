"""The driver with an arm on paper: the gripper, and setpoints that the arm cannot follow."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.state.arm_report import ArmMode
from katana450.extensions.real_arm.codec.replies import AxisStatus
from katana450.extensions.real_arm.codec.requests import More, MotorFlag, SendSplines
from tests.real_arm.paper_arm import ENDS, JOINTS, MAP, Conversation, sway


def test_gripper_moves_by_targets_and_not_by_polynomials(talk: Conversation) -> None:
    talk.engage()
    start = talk.now
    talk.setpoint = lambda t: JOINTS + np.array([0, 0, 0, 0, 0, 0.2 * min(t - start, 1.0)])
    talk.run(3.0)
    assert not talk.sent(SendSplines)
    moves = [r for _, r in talk.arm.requests if getattr(r, "flag", None) == MotorFlag.MOVE]
    assert 8 <= len(moves) <= 12
    assert talk.reports[-1][2][5] == pytest.approx(JOINTS[5] + 0.2, abs=2e-3)
    assert talk.mode() is ArmMode.HOLDING


def test_object_between_the_fingers_is_held_and_is_no_collision(talk: Conversation) -> None:
    talk.engage()
    talk.arm.states[5] = AxisStatus.COLLIDED
    talk.run(0.5)
    assert talk.machine.mode.follows
    assert talk.motors[7:] == [(6, MotorFlag.FREEZE)]


def test_stop_lets_fingers_at_rest_keep_what_they_hold(talk: Conversation) -> None:
    talk.engage()
    start = talk.now
    talk.setpoint = lambda t: JOINTS + np.array([0, 0, 0, 0, 0, -0.2 * min(t - start, 0.5)])
    talk.run(2.0)
    talk.setpoint = sway(talk.now)
    grip = talk.reports[-1][2][5] - 0.05
    talk.setpoint = lambda t: np.array([*sway(start + 2.0)(t)[:5], grip])
    talk.run(1.5)
    count = len(talk.motors)
    talk.stopped = True
    talk.run(0.5)
    assert all(axis != 6 for axis, _ in talk.motors[count:])
    held = talk.reports[-1][2]
    talk.setpoint = lambda _: np.array([*held[:5], grip])
    talk.stopped = False
    count = len(talk.motors)
    talk.run(1.0)
    assert len(talk.motors) == count


def test_leap_of_the_setpoint_is_a_fault_and_no_motion(talk: Conversation) -> None:
    talk.engage()
    talk.setpoint = lambda _: JOINTS + 0.2
    talk.run(1.0)
    assert talk.mode() is ArmMode.FAULT
    assert "not where the arm is" in talk.machine.note
    assert not talk.sent(SendSplines)


def test_silent_control_loop_is_braked_before_the_arm_runs_dry(talk: Conversation) -> None:
    talk.engage()
    talk.setpoint = sway(talk.now)
    talk.run(1.3)
    talk._tick = np.inf
    talk.run(2.0)
    assert talk.mode() is ArmMode.FAULT
    assert "too late" in talk.machine.note
    assert not talk.arm.starved
    last = talk.sent(SendSplines)[-1]
    assert isinstance(last, SendSplines)
    assert last.more == More.LAST
    assert all(segment.speed_at(8) == 0.0 for segment in last.segments)


def test_setpoint_beyond_the_limits_ends_at_them(talk: Conversation) -> None:
    talk.engage()
    start = talk.now
    talk.setpoint = lambda t: JOINTS + np.array([-1.0, 0, 0, 0, 0, 0]) * min(t - start, 4.0)
    talk.run(6.0)
    assert talk.mode() is ArmMode.HOLDING
    assert talk.arm.place[0] == MAP.upper[0]
    assert talk.reports[-1][2][0] == pytest.approx(ENDS[0][0], abs=1e-9)
