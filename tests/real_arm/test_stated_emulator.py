"""The emulator as documented: speeds, presses, lost connections, and any message."""

from __future__ import annotations

import random
import time

import pytest

from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.codecs import FirmwareCodec, crc16, with_crc
from katana450.extensions.real_arm.codec.requests import REQUESTS
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.axis import COLLISION_LIMIT
from katana450.extensions.real_arm.emulator.firmware import Firmware
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from tests.conftest import LONG
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
    bench.block(1)
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
    server = EmulatorServer(EmulatedArm(calibrated=True))
    server.start()
    try:
        with linked(server.port) as link:
            link.exchange(req.CommandMotor(1, req.MotorFlag.MOVE, 0))
        with server.lock:
            start = server.arm.axes[0].plant.position
        time.sleep(0.5)
        with server.lock:
            moved = abs(server.arm.axes[0].plant.position - start)
            assert server.arm.axes[0].plant.speed != 0.0
        assert moved > 100.0
    finally:
        server.stop()


FRAMES = 20_000 if LONG else 1_500

NOISE_BYTES = 200_000 if LONG else 20_000


def frame(chance: random.Random) -> bytes:
    """Return a request of any kind with any numbers, which small ones make meaningful."""
    kind = chance.choice(REQUESTS)
    size = kind.length() - len(kind.HEAD)
    numbers = bytes(chance.choice((0, 1, 2, 6, 24, chance.randrange(256))) for _ in range(size))
    payload = kind.HEAD + numbers
    return bytes((1, 24, len(payload))) + with_crc(payload)


@pytest.mark.parametrize("calibrated", [True, False])
def test_any_request_has_an_answer_of_the_right_form(*, calibrated: bool) -> None:
    chance = random.Random(450)
    arm = EmulatedArm(calibrated=calibrated)
    firmware, codec = Firmware(arm), FirmwareCodec()
    refused = 0
    for _ in range(FRAMES):
        (event,) = codec.receive(frame(chance))
        reply = firmware.handle(event)
        assert int.from_bytes(reply[-2:], "big") == crc16(reply[:-2])
        refused += reply == b"\xc0\x50\x00"
        arm.step(chance.choice((0.0, 0.001, 0.02)))
        for axis in arm.axes:
            low, high = axis.facts.stops
            assert low <= axis.plant.position <= high
    assert 0 < refused < FRAMES


def test_noise_is_answered_by_refusals_only() -> None:
    chance = random.Random(451)
    arm = EmulatedArm(calibrated=True)
    before = [axis.position for axis in arm.axes]
    firmware, codec = Firmware(arm), FirmwareCodec()
    for _ in range(NOISE_BYTES // 50):
        for event in codec.receive(chance.randbytes(50)):
            assert firmware.handle(event)[0] in (0xC0, 0xC1)
        arm.step(0.01)
    assert [axis.position for axis in arm.axes] == pytest.approx(before, abs=20)
