"""The emulated arm answers and moves as the protocol describes, by simulated time."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.replies import AxisStatus
from katana450.extensions.real_arm.codec.requests import AxisSegment
from katana450.extensions.real_arm.emulator.arm import (
    EmulatedArm,
    joints_at,
    loads_of_robot,
)
from katana450.extensions.real_arm.emulator.axis import DEPTH, SplineBuffer
from katana450.extensions.real_arm.plant.axis import KATANA450
from tests.real_arm.emulated import HOLDS, Bench, at_rest

CALIBRATED = (30500, -30500, -30500, 30500, 30500, 30500)


@pytest.fixture
def bench(robot: Robot) -> Bench:
    return Bench(EmulatedArm(loads=loads_of_robot(robot), calibrated=True))


@pytest.fixture
def stiff() -> Bench:
    exact = {"bandwidth": 200.0, "coulomb": 1e-3, "viscous": 0.0, "droop": 0.0, "backlash": 0.0}
    return Bench(EmulatedArm(replace(KATANA450, reserve=1e3, **exact), calibrated=True))


def test_calibration_finds_the_stops_of_an_arm_after_power_up(robot: Robot) -> None:
    bench = Bench(EmulatedArm(loads=loads_of_robot(robot)))
    assert bench.states == (AxisStatus.OFF,) * 6
    assert bench.positions == (0,) * 6
    bench.ask(req.SetCollisionDetection(0))
    bench.ask(req.CommandMotor(req.ALL_AXES, req.MotorFlag.CALIBRATE, 32000))
    assert bench.states == (AxisStatus.CALIBRATING,) * 6
    assert 20.0 < bench.wait_until(HOLDS, 60.0) < 40.0
    bench.wait(1.0)
    for position, wanted in zip(bench.positions, CALIBRATED, strict=True):
        assert abs(position - wanted) < 100
    for axis in bench.arm.axes:
        assert abs(axis.position - axis.plant.position) < 10, "the counts are those of the arm"


def test_uncalibrated_arm_refuses_to_move_and_says_why() -> None:
    bench = Bench(EmulatedArm())
    error = bench.refused(req.CommandMotor(2, req.MotorFlag.MOVE, 100))
    assert (error.code, error.axis, error.text) == (-3, 2, "axis is not calibrated")
    still = (AxisSegment(10, 0, 0, 0, 0, 0),) * 6
    assert bench.refused(req.SendSplines(still, 1)).code == -3


def test_freeze_ends_a_calibration_without_calibrating() -> None:
    bench = Bench(EmulatedArm())
    bench.ask(req.CommandMotor(0, req.MotorFlag.CALIBRATE, 32000))
    bench.wait(1.0)
    bench.ask(req.CommandMotor(0, req.MotorFlag.FREEZE, 0))
    bench.wait(0.5)
    assert set(bench.states) == {AxisStatus.FIXED}
    assert at_rest(bench.arm)
    assert not all(axis.is_calibrated for axis in bench.arm.axes)


def test_target_is_reached_within_the_limits_that_the_host_set(bench: Bench) -> None:
    bench.ask(req.SetAxisParameter(1, 3, 100, 50))
    bench.ask(req.SetAxisParameter(1, 4, 2, 0))
    bench.move(1, 10000)
    assert bench.states[0] == AxisStatus.MOVING_TO_TARGET
    before, speeds = bench.positions[0], []
    while bench.states[0] != AxisStatus.FIXED:
        bench.wait(0.1)
        speeds.append((bench.positions[0] - before) / 10.0)
        before = bench.positions[0]
    bench.wait(0.5)
    assert min(speeds) == pytest.approx(-50.0, abs=0.5), "the limit of falling counts"
    assert speeds[0] == pytest.approx(-2.0 * 10.0 / 2.0, abs=1.5), (
        "half the speed of the first 0.1 s"
    )
    assert abs(bench.positions[0] - 10000) < 20
    assert bench.ask(req.ReadAxis(1)).status == AxisStatus.FIXED


def test_splines_are_followed_as_the_closed_polynomial(stiff: Bench) -> None:
    # Two cubics of axis 1, with position and speed continuous where they meet.
    first = AxisSegment(20, 30420, 30500, 0, -307, 164)
    start = round(first.speed_at(20) * 64)
    second = AxisSegment(12, 0, 30420, start, 40, -90)
    second = second._replace(target=round(second.at(12)))
    stiff.splines(1, [first, second])
    axis, worst = stiff.arm.axes[0], 0.0
    for step in range(1, 4 * 32):
        stiff.arm.step(0.0025)
        tick = step / 4.0
        wanted = first.at(tick) if tick < 20 else second.at(tick - 20)
        assert axis.setpoint == pytest.approx(wanted, abs=0.5)
        worst = max(worst, abs(axis.plant.position - wanted))
    assert 0.0 < worst < 0.5, "an axis without friction follows its setpoint"
    assert stiff.wait_until(HOLDS, 1.0) <= 0.02
    assert stiff.states == (AxisStatus.SPLINES_DONE,) * 6
    assert abs(stiff.positions[0] - second.target) <= 1


def test_gripper_follows_no_polynomial(stiff: Bench) -> None:
    still = [AxisSegment(10, position, position, 0, 0, 0) for position in stiff.positions]
    still[5] = AxisSegment(10, 30400, 30500, -640, 0, 0)
    stiff.ask(req.SendSplines(tuple(still), 1))
    stiff.wait(0.2)
    assert stiff.positions[5] == 30500
    assert stiff.states[5] == AxisStatus.SPLINES_DONE


def test_stored_splines_wait_for_the_start(bench: Bench) -> None:
    hold = AxisSegment(10, 30500, 30500, 0, 0, 0)
    bench.splines(1, [hold, hold], last=False)
    bench.wait(0.3)
    assert AxisStatus.MOVING not in bench.states
    bench.splines(1, [hold])
    assert bench.states[0] == AxisStatus.MOVING
    assert bench.wait_until(HOLDS, 1.0) == pytest.approx(0.3, abs=0.011)


def test_full_buffer_is_reported_and_refuses_the_next_polynomial(bench: Bench) -> None:
    hold = AxisSegment(10, 30500, 30500, 0, 0, 0)
    bench.splines(1, [hold] * (DEPTH - 1), last=False)
    bench.ask(req.SendSplines((hold,) * 6, 0))
    assert bench.states[:5] == (AxisStatus.SPLINE_BUFFER_FULL,) * 5
    packet = req.SendSplines((hold,) * 6, 0)
    error = bench.refused(packet)
    assert (error.code, error.axis, error.text) == (-9, 1, "move buffer error")
    bench.wait(0.1)
    assert bench.states[0] == AxisStatus.MOVING


def test_late_polynomial_finds_the_arm_at_the_end_of_the_last(stiff: Bench) -> None:
    hold = AxisSegment(10, 30500, 30500, 0, 0, 0)
    stiff.ask(req.SendSplines((hold,) + (AxisSegment(10, 0, 0, 0, 0, 0),) * 5, 2))
    buffer = SplineBuffer()
    buffer.store(AxisSegment(10, 110, 100, 64, 0, 0), req.More.START)
    buffer.start(req.More.START)
    buffer.advance(0.5)
    assert (buffer.position, buffer.speed, buffer.is_running) == (110.0, 0.0, True)
    buffer.store(AxisSegment(10, 120, 110, 64, 0, 0), req.More.LAST)
    buffer.advance(0.05)
    assert buffer.position == pytest.approx(115.0)
    buffer.advance(0.05)
    assert not buffer.is_running


def test_empty_polynomials_are_passed_over() -> None:
    buffer = SplineBuffer()
    for segment in (
        AxisSegment(0, 100, 100, 0, 0, 0),
        AxisSegment(10, 110, 100, 64, 0, 0),
        AxisSegment(0, 110, 110, 0, 0, 0),
        AxisSegment(10, 120, 110, 64, 0, 0),
    ):
        buffer.store(segment, req.More.STORE)
    buffer.start(req.More.LAST)
    places = []
    while buffer.is_running:
        buffer.advance(0.05)
        places.append(buffer.position)
    assert places == [105.0, 110.0, 115.0, 120.0]


def test_flush_drops_what_waits_and_freeze_stops_at_once(bench: Bench) -> None:
    ramp = [AxisSegment(20, 30500 - 800 * n, 31300 - 800 * n, -2560, 0, 0) for n in range(1, 9)]
    bench.splines(1, ramp)
    bench.wait(0.3)
    bench.ask(req.CommandMotor(0, req.MotorFlag.FLUSH, 0))
    place = bench.positions[0]
    bench.ask(req.CommandMotor(1, req.MotorFlag.FREEZE, place))
    bench.wait(0.3)
    assert 0 <= place - bench.positions[0] < 300, "it brakes as hard as the motor can"
    assert at_rest(bench.arm)


def test_obstacle_stops_the_arm_until_it_is_unblocked(bench: Bench) -> None:
    bench.confine(1, 25000, 31000)
    for axis in (1, 2):
        bench.ask(req.SetAxisParameter(axis, 3, 180, 180))
    bench.move(1, 0)
    bench.move(2, 0)
    bench.wait(5.0)
    assert bench.states == (40, 8, 8, 8, 8, 8)
    assert bench.positions[0] == pytest.approx(25000, abs=30)
    assert bench.positions[1] < -5000, "the other axis stopped on its way"
    error = bench.refused(req.CommandMotor(1, req.MotorFlag.MOVE, 20000))
    assert (error.code, error.axis) == (-10, 30)
    assert error.text == "StopperThread: collision on axis: 1"
    for axis, place in enumerate(bench.positions, 1):
        bench.ask(req.CommandMotor(axis, req.MotorFlag.FREEZE, place))
    bench.wait(0.5)
    assert set(bench.states) == {AxisStatus.FIXED}
    bench.move(1, 28000)
    bench.wait(5.0)
    assert bench.positions[0] == pytest.approx(28000, abs=30)


def test_gripper_that_holds_something_does_not_keep_the_arm_blocked() -> None:
    bench = Bench(EmulatedArm(calibrated=True))
    bench.confine(6, 27600.0, bench.arm.axes[5].facts.stops[1])
    bench.move(6, 12240)
    bench.wait(4.0)
    bench.block(1)
    bench.move(1, 29000)
    bench.wait(2.0)
    assert bench.states == (40, 8, 8, 8, 8, 40)
    bench.confine(1, *bench.arm.axes[0].facts.stops)
    bench.ask(req.CommandMotor(1, req.MotorFlag.FREEZE, bench.positions[0]))
    bench.move(1, 29000)
    bench.wait(3.0)
    assert bench.positions[0] == pytest.approx(29000, abs=30)
    assert bench.states[5] == 40, "it still holds"


def test_no_collision_is_found_while_detection_is_off(bench: Bench) -> None:
    bench.block(1)
    bench.ask(req.SetCollisionDetection(0))
    bench.move(1, 29000)
    bench.wait(3.0)
    assert bench.states[0] == AxisStatus.FIXED
    bench.ask(req.SetCollisionDetection(1))
    bench.arm.touch()
    bench.wait(0.1)
    assert bench.states[0] == AxisStatus.COLLIDED


def test_arm_falls_when_its_motors_are_switched_off(bench: Bench) -> None:
    bench.ask(req.SetAxisParameter(2, 3, 180, 180))
    bench.move(2, -10000)
    bench.wait(5.0)
    before = bench.positions[1]
    bench.ask(req.CommandMotor(0, req.MotorFlag.OFF, 0))
    bench.wait(5.0)
    assert set(bench.states) == {AxisStatus.OFF}
    assert bench.positions[1] - before > 10000, "axis 2 sinks towards its lower end"


def test_stops_are_the_limits_of_the_described_arm(robot: Robot) -> None:
    chain = robot.require_arm().chain
    ends = [
        joints_at([axis.facts.stops[side] for axis in EmulatedArm().axes])[0] for side in (0, 1)
    ]
    low, high = zip(*(sorted(pair) for pair in zip(*ends, strict=True)), strict=True)
    assert low == pytest.approx(chain.lower.tolist(), abs=math.radians(0.01))
    assert high == pytest.approx(chain.upper.tolist(), abs=math.radians(0.01))


def test_unknown_axis_and_parameter_are_refused(bench: Bench) -> None:
    assert bench.refused(req.SetAxisParameter(7, 3, 1, 1)).code == -2
    assert bench.refused(req.SetAxisParameter(1, 244, 0, 0)).code == -2
