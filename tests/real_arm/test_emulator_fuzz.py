"""The emulated arm answers anything that a client sends, and moves within its stops."""

from __future__ import annotations

import random

import pytest

from katana450.extensions.real_arm.codec.crc import crc16, with_crc
from katana450.extensions.real_arm.codec.firmware_codec import FirmwareCodec
from katana450.extensions.real_arm.codec.requests import REQUESTS
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.firmware import Firmware
from tests.conftest import LONG

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
