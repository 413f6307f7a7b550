"""The state machine of the driver, with an arm on paper: modes, acts, faults and setpoints."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.extensions.real_arm.codec.replies import AxisStatus, FirmwareError
from katana450.extensions.real_arm.codec.requests import (
    CommandMotor,
    More,
    MotorFlag,
    ReadAxis,
    ReadSensors,
    ReadStates,
    SendSplines,
    SetAxisParameter,
    SetCollisionDetection,
)
from tests.real_arm.paper_arm import ENDS, HOME, JOINTS, MAP, Conversation, sway

COLLISION = FirmwareError(ord("H"), -10, 3, "StopperThread: collision on axis: 3")


def test_nothing_is_sent_before_a_person_connects(talk: Conversation) -> None:
    talk.run(1.0)
    assert talk.mode() is ArmMode.DISCONNECTED
    assert not talk.arm.requests


def test_connection_only_reads(talk: Conversation) -> None:
    talk.connect()
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert "Firmware 2.1" in talk.machine.note
    names = {type(request).__name__ for _, request in talk.arm.requests}
    assert names == {
        "ReadMasterVersion", "ReadArmIdentity", "ReadSlaveVersion", "ReadPositions", "ReadStates",
        "ReadSensors",
    }  # fmt: skip
    _, report, q = talk.reports[-1]
    assert np.allclose(q, JOINTS, atol=1e-3)
    assert report.sensors == tuple(map(float, range(16)))


def test_engage_freezes_each_axis_where_it_is(talk: Conversation) -> None:
    talk.engage()
    expected = [(0, MotorFlag.FLUSH), *((axis, MotorFlag.FREEZE) for axis in range(1, 7))]
    assert talk.motors == expected
    frozen = [r.value for _, r in talk.arm.requests if isinstance(r, CommandMotor)][1:]
    assert frozen == HOME.tolist()
    assert talk.sent(SetCollisionDetection) == [SetCollisionDetection(1)]


def test_engage_that_is_refused_leaves_the_arm_uncalibrated(talk: Conversation) -> None:
    talk.connect()
    talk.arm.refusals[CommandMotor] = FirmwareError(ord("C"), -3, 0, "not calibrated")
    talk.machine.perform(ArmAct.ENGAGE)
    talk.run(1.0)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert "not in the right state ('not calibrated')" in talk.machine.note


def test_calibration_waits_until_the_arm_has_ended_it(talk: Conversation) -> None:
    talk.connect()
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.run(1.0)
    assert talk.mode() is ArmMode.CALIBRATING
    assert talk.sent(SetCollisionDetection) == [SetCollisionDetection(0)]
    talk.run(2.0)
    assert talk.mode() is ArmMode.HOLDING
    assert talk.sent(SetCollisionDetection)[-1] == SetCollisionDetection(1)
    assert (0, MotorFlag.CALIBRATE) in talk.motors
    assert talk.sent(SetAxisParameter)
    assert (talk.machine.arm.held == [30500, -30500, -30500, 30500, 30500, 30500]).all()


def test_stop_ends_a_calibration_and_leaves_the_arm_uncalibrated(talk: Conversation) -> None:
    talk.connect()
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.run(1.0)
    assert talk.mode() is ArmMode.CALIBRATING
    before = len(talk.motors)
    # Two presses are one stop.
    talk.machine.end_act(talk.now)
    talk.machine.end_act(talk.now)
    talk.run(0.3)
    assert talk.motors[before] == (0, MotorFlag.FLUSH)
    frozen = talk.motors[before + 1 :]
    assert sorted(frozen) == [(axis, MotorFlag.FREEZE) for axis in range(1, 7)]
    talk.run(2.0)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert talk.machine.note.startswith("STOP ended the calibration")
    assert ArmAct.UNBLOCK not in talk.mode().acts


@pytest.mark.parametrize("pressed", ["while lost", "later", "not at all"])
def test_stop_freezes_an_arm_that_still_calibrates_after_a_lost_connection(
    talk: Conversation, pressed: str
) -> None:
    talk.connect()
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.run(0.5)
    assert talk.mode() is ArmMode.CALIBRATING
    talk.machine.lost("The test cut the connection.")
    if pressed == "while lost":
        talk.machine.end_act(talk.now)
    before = len(talk.motors)
    talk.machine.connected("tcp://paper:5566")
    talk.run(0.2)
    if pressed == "later":
        assert "is calibrating: wait" in talk.machine.note
        talk.machine.end_act(talk.now)
    talk.run(0.3)
    frozen = sorted(talk.motors[before:])
    if pressed == "not at all":
        assert not frozen
        return
    assert frozen == [(0, MotorFlag.FLUSH), *((axis, MotorFlag.FREEZE) for axis in range(1, 7))]
    talk.run(1.0)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert talk.machine.note.startswith("STOP froze the arm")
    # The press counts once: what a person begins after it is not stopped.
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.run(1.0)
    assert talk.mode() is ArmMode.CALIBRATING


def test_stop_at_an_arm_that_rests_or_is_not_connected_sends_nothing(talk: Conversation) -> None:
    talk.machine.end_act(talk.now)
    talk.connect()
    talk.machine.end_act(talk.now)
    talk.run(0.5)
    assert not talk.motors


def test_stop_drops_an_act_that_waits(talk: Conversation) -> None:
    talk.connect()
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.machine.end_act(talk.now)
    talk.run(1.0)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert not talk.motors


def test_refused_calibration_switches_collision_detection_on_again(talk: Conversation) -> None:
    talk.connect()
    talk.arm.refusals[CommandMotor] = FirmwareError(ord("C"), -1, 0, "")
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.run(1.0)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert talk.sent(SetCollisionDetection)[-1] == SetCollisionDetection(1)


def test_axis_that_refuses_during_calibration_does_not_end_it(talk: Conversation) -> None:
    talk.connect()
    talk.arm.refusals[ReadAxis] = FirmwareError(ord("D"), -1, 6, "")
    talk.machine.perform(ArmAct.CALIBRATE)
    talk.run(3.5)
    assert talk.mode() is ArmMode.HOLDING


def test_release_switches_every_motor_off(talk: Conversation) -> None:
    talk.engage()
    talk.stopped = True
    talk.machine.perform(ArmAct.RELEASE)
    talk.run(0.5)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert talk.machine.note == "Motors off: the arm is not held."
    assert talk.motors[-6:] == [(axis, MotorFlag.OFF) for axis in range(1, 7)]


@pytest.mark.parametrize("act", [ArmAct.UNBLOCK, ArmAct.CONNECT])
def test_act_that_is_impossible_does_nothing(talk: Conversation, act: ArmAct) -> None:
    talk.connect()
    count = len(talk.motors)
    talk.machine.perform(act)
    talk.run(0.5)
    assert talk.mode() is ArmMode.UNCALIBRATED
    assert len(talk.motors) == count


@pytest.mark.parametrize("delay", [0.0005, 0.002, 0.02, 0.04])
def test_motion_is_followed_with_two_to_four_segments_ahead(
    talk: Conversation, delay: float
) -> None:
    talk.engage()
    rng = np.random.default_rng(3)
    talk.delay = lambda: delay * rng.uniform(0.9, 1.2)
    start = talk.now
    talk.setpoint = sway(talk.now)
    talk.run(3.0)
    assert talk.mode() is ArmMode.MOVING
    talk.run(4.0)
    assert talk.mode() is ArmMode.HOLDING
    assert not talk.arm.starved
    assert 2.0 <= min(talk.arm.buffers[:-8]) <= max(talk.arm.buffers) <= 4.5
    packets = [packet for packet in talk.sent(SendSplines) if isinstance(packet, SendSplines)]
    assert [packet.more for packet in packets[:4]] == [More.STORE] * 3 + [More.START]
    assert [packet.more for packet in packets].count(More.LAST) == 1
    assert packets[-1].more == More.LAST
    errors = [
        np.abs(q - report.expected)[:5].max()
        for t, report, q in talk.reports
        if t > start and report.mode.follows
    ]
    # Positions are measured within an exchange, so their time is known to half of it.
    assert max(errors) < 0.002 + 1.0 * delay
    ages = [t - report.t for t, report, _ in talk.reports if t > start]
    assert max(ages) < 0.1 + 4 * delay


def test_second_motion_waits_for_the_end_of_the_first(talk: Conversation) -> None:
    talk.engage()
    talk.setpoint = sway(talk.now)
    talk.run(4.7)
    before = talk.setpoint(talk.now)
    again = talk.now
    talk.setpoint = lambda t: before + np.array([0.05, 0, 0, 0, 0, 0]) * min(t - again, 1.0)
    talk.run(3.0)
    packets = talk.sent(SendSplines)
    last = [i for i, packet in enumerate(packets) if getattr(packet, "more", 0) == More.LAST]
    assert len(last) == 2
    assert not talk.arm.starved
    assert np.abs(talk.reports[-1][2] - talk.setpoint(talk.now)).max() < 2e-4
    assert talk.mode() is ArmMode.HOLDING


def test_stop_freezes_the_fastest_axis_first_and_is_measured(talk: Conversation) -> None:
    talk.engage()
    talk.setpoint = sway(talk.now)
    talk.run(1.0)
    count = len(talk.motors)
    talk.stopped = True
    talk.run(0.5)
    assert talk.mode() is ArmMode.HOLDING
    orders = talk.motors[count:]
    assert orders[0] == (0, MotorFlag.FLUSH)
    assert sorted(orders[1:]) == [(axis, MotorFlag.FREEZE) for axis in range(1, 6)]
    # In rad/s axes 1, 2, 4 and 5 are equally fast, axis 3 has half of their speed.
    assert orders[-1] == (3, MotorFlag.FREEZE)
    measured = talk.reports[-1][1].measured_stop
    assert measured is not None
    assert 0.0 < measured.time < 0.1
    assert 0.0 < measured.angle < 0.05
    # Axis 1 is among the fastest, so its angle is the largest.
    assert measured.distance == pytest.approx(2.0 * measured.angle, rel=0.1)
    # Setpoints while stopped move nothing, nor does the first one after it.
    rest = talk.machine.arm.positions.copy()
    talk.run(0.5)
    held = talk.reports[-1][2]
    talk.setpoint = lambda _: held
    talk.stopped = False
    talk.run(1.0)
    assert np.abs(talk.machine.arm.positions - rest).max() <= 1
    assert talk.reports[-1][1].measured_stop is measured
    # A later stop at rest does not show the figures of this one.
    talk.stopped = True
    talk.run(0.3)
    assert talk.reports[-1][1].measured_stop is None


def test_slow_exchanges_freeze_each_axis_at_a_fresh_position(talk: Conversation) -> None:
    talk.engage()
    talk.delay = lambda: 0.04
    talk.setpoint = sway(talk.now)
    talk.run(1.5)
    start = talk.now
    talk.stopped = True
    talk.run(1.0)
    stop = [request for t, request in talk.arm.requests if t > start]
    assert len(talk.motors) > 5
    freezes = [i for i, r in enumerate(stop) if getattr(r, "flag", None) == MotorFlag.FREEZE]
    reads = [i for i, r in enumerate(stop) if type(r).__name__ == "ReadPositions"]
    assert all(any(0 < i - read <= 4 for read in reads) for i in freezes)


@pytest.mark.parametrize("status", [AxisStatus.COLLIDED, AxisStatus.OFF, AxisStatus.DATA_INVALID])
def test_bad_status_of_an_axis_stops_the_others(talk: Conversation, status: int) -> None:
    talk.engage()
    talk.run(0.2)
    talk.arm.states[2] = status
    talk.run(0.6)
    collided = status == AxisStatus.COLLIDED
    assert talk.mode() is (ArmMode.COLLIDED if collided else ArmMode.FAULT)
    frozen_again = (3, MotorFlag.FREEZE) in talk.motors[7:]
    assert frozen_again is not collided
    assert ("axis 3" in talk.machine.note) if collided else ("Axis 3" in talk.machine.note)
    talk.stopped = True
    talk.machine.perform(ArmAct.UNBLOCK)
    talk.run(1.5)
    assert talk.mode() is ArmMode.HOLDING


def test_refused_packet_stops_the_arm(talk: Conversation) -> None:
    talk.engage()
    talk.setpoint = sway(talk.now)
    talk.run(1.0)
    talk.arm.refusals[SendSplines] = COLLISION
    talk.arm.states[2] = AxisStatus.COLLIDED
    count = len(talk.sent(SendSplines))
    talk.run(1.0)
    assert talk.mode() in (ArmMode.COLLIDED, ArmMode.FAULT)
    assert len(talk.sent(SendSplines)) == count + 1


def test_measurements_may_be_refused_now_and_then(talk: Conversation) -> None:
    talk.engage()
    for _ in range(5):
        talk.arm.refusals[ReadStates] = FirmwareError(ord("N"), -12, 0, "")
        talk.run(0.3)
    assert talk.mode() is ArmMode.HOLDING


def test_arm_without_sensors_is_not_asked_again(talk: Conversation) -> None:
    talk.engage()
    talk.arm.refusals[ReadSensors] = FirmwareError(ord("E"), -13, 0, "")
    talk.run(2.0)
    count = len(talk.sent(ReadSensors))
    talk.run(2.0)
    assert len(talk.sent(ReadSensors)) == count


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
