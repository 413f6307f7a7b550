"""Speeds, presses, lost connections and late replies of the emulator, as documented."""

from __future__ import annotations

import time

import pytest

from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.axis import COLLISION_LIMIT
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from tests.real_arm.emulated import Bench, linked


@pytest.mark.parametrize(("axis", "factor"), [(1, -1.0), (2, -1.0), (3, -2.0), (4, -1.0), (5, 1.0)])
def test_reported_speed_has_the_stated_sign_and_size(axis: int, factor: float) -> None:
    bench = Bench(EmulatedArm(calibrated=True))
    start = bench.positions[axis - 1]
    bench.move(axis, round(0.3 * start))
    bench.wait(0.5)
    before = bench.positions[axis - 1]
    reading = bench.ask(req.ReadAxis(axis))
    bench.wait(0.1)
    speed = (bench.positions[axis - 1] - before) / 10.0
    assert abs(speed) > 5.0
    assert reading.velocity == pytest.approx(factor * speed, abs=0.12 * abs(factor * speed) + 1.0)


def test_axis_that_presses_with_its_whole_current_stops_the_arm() -> None:
    bench = Bench(EmulatedArm(calibrated=True))
    # No deviation counts as a collision any more.
    bench.ask(req.SetAxisParameter(1, COLLISION_LIMIT, 255, 255))
    bench.arm.block(1)
    bench.move(1, 0)
    pressed = None
    for _ in range(1000):
        bench.wait(0.0025, step=0.0025)
        if pressed is None and abs(bench.arm.axes[0].plant.effort) >= 1.0:
            pressed = bench.arm.time
        if bench.states[0] == 40:
            break
    assert pressed is not None
    assert bench.arm.time - pressed == pytest.approx(0.15, abs=0.01)


def test_lost_connection_stops_no_motion() -> None:
    server = EmulatorServer(EmulatedArm(calibrated=True), "127.0.0.1", 0)
    server.start()
    try:
        with linked(server.port) as link:
            link.exchange(req.CommandMotor(1, req.MotorFlag.MOVE, 0))
        with server.lock:
            begun = server.arm.axes[0].plant.position
        time.sleep(0.5)
        with server.lock:
            moved = abs(server.arm.axes[0].plant.position - begun)
            assert server.arm.axes[0].plant.speed != 0.0
        assert moved > 100.0
    finally:
        server.stop()


def test_replies_are_late_and_the_arm_moves_meanwhile() -> None:
    delays = iter([0.0, 0.03, 0.05])
    server = EmulatorServer(EmulatedArm(calibrated=True), "127.0.0.1", 0, lambda: next(delays))
    server.start()
    try:
        with linked(server.port) as link:
            link.exchange(req.EchoRequest())
            begun = server.arm.time
            link.exchange(req.EchoRequest())
            link.exchange(req.EchoRequest())
            assert server.arm.time - begun > 0.07
            assert sorted(link.round_trips)[-2] > 0.03
    finally:
        server.stop()
