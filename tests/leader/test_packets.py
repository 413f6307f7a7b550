"""Packets of the servo bus: worked bytes, every split, garbage."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.extensions.motor_bus.dynamixel import DYNAMIXEL
from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.extensions.motor_bus.packets import (
    BROADCAST,
    MAX_LENGTH,
    Instruction,
    Packet,
    PacketReader,
    ServoMake,
)

FEETECH_WORKED = (
    # The first two are examples of Feetech's protocol manual.
    (Packet(1, Instruction.PING), "ff ff 01 02 01 fb"),
    (Packet(1, Instruction.READ, b"\x38\x02"), "ff ff 01 04 02 38 02 be"),
    (Packet(1, Instruction.WRITE, b"\x28\0"), "ff ff 01 04 03 28 00 cf"),
    (
        Packet(BROADCAST, Instruction.SYNC_READ, b"\x38\x08\x01\x02"),
        "ff ff fe 06 82 38 08 01 02 36",
    ),
    (Packet(1, 0, bytes((0x18, 0x05))), "ff ff 01 04 00 18 05 dd"),
)
DYNAMIXEL_WORKED = (
    # Examples of ROBOTIS' manual of the protocol.
    (Packet(1, Instruction.PING), "ff ff fd 00 01 03 00 01 19 4e"),
    (Packet(1, 0, b"\x06\x04\x26", True), "ff ff fd 00 01 07 00 55 00 06 04 26 65 5d"),
    (
        Packet(1, Instruction.READ, b"\x84\0\x04\0"),
        "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15",
    ),
    (Packet(1, 0, b"\xa6\0\0\0", True), "ff ff fd 00 01 08 00 55 00 a6 00 00 00 8c c0"),
    (
        Packet(1, Instruction.WRITE, b"\x74\0\0\x02\0\0"),
        "ff ff fd 00 01 09 00 03 74 00 00 02 00 00 ca 89",
    ),
    (Packet(1, Instruction.REBOOT), "ff ff fd 00 01 03 00 08 2f 4e"),
)
MAKES = [(FEETECH, FEETECH_WORKED), (DYNAMIXEL, DYNAMIXEL_WORKED)]


@pytest.mark.parametrize(("make", "worked"), MAKES)
def test_worked_bytes(make: ServoMake, worked: tuple[tuple[Packet, str], ...]) -> None:
    for packet, text in worked:
        data = bytes.fromhex(text)
        assert make.framing.encoded(packet) == data
        for place in range(len(data) + 1):
            reader = PacketReader(make.framing)
            assert reader.feed(data[:place]) + reader.feed(data[place:]) == [packet]


@pytest.mark.parametrize("make", [FEETECH, DYNAMIXEL])
@given(st.lists(st.sampled_from(b"\xff\xfd\x00\x01"), max_size=40))
@settings(max_examples=50)
def test_content_like_a_header_is_stuffed(make: ServoMake, content: list[int]) -> None:
    packet = Packet(BROADCAST, Instruction.SYNC_WRITE, bytes(content))
    data = make.framing.encoded(packet)
    assert PacketReader(make.framing).feed(data) == [packet]
    if make is DYNAMIXEL:
        assert data.count(make.framing.header) == 1


@pytest.mark.parametrize(("make", "worked"), MAKES)
def test_packets_are_found_in_any_split_of_a_stream_with_garbage(
    make: ServoMake, worked: tuple[tuple[Packet, str], ...]
) -> None:
    random.seed(7)
    expected = [packet for packet, _ in worked] * 20
    # Garbage without the first byte of a header, and headers that begin nothing.
    noise = [bytes(random.randrange(0xFF) for _ in range(5)), b"\xff\xff\xff", b"\xff\xff\x01\x00"]
    framing = make.framing
    stream = b"".join(random.choice(noise) + framing.encoded(packet) for packet in expected)
    for _ in range(50):
        reader, packets, place = PacketReader(framing), [], 0
        while place < len(stream):
            end = place + random.randint(1, 9)
            packets += reader.feed(stream[place:end])
            place = end
        assert packets == expected


@pytest.mark.parametrize(("make", "worked"), MAKES)
def test_wrong_check_value_is_no_packet_and_hides_none(
    make: ServoMake, worked: tuple[tuple[Packet, str], ...]
) -> None:
    (good, text), (_, other) = worked[0], worked[2]
    wrong = bytearray.fromhex(other)
    wrong[-1] ^= 0x10
    assert PacketReader(make.framing).feed(bytes(wrong) + bytes.fromhex(text)) == [good]


@pytest.mark.parametrize("make", [FEETECH, DYNAMIXEL])
@settings(max_examples=50)
@given(st.binary(max_size=400))
def test_any_bytes_raise_nothing_and_keep_little(make: ServoMake, data: bytes) -> None:
    reader = PacketReader(make.framing)
    for packet in reader.feed(data):
        assert make.framing.encoded(packet) in data
    assert len(reader._rest) <= MAX_LENGTH + 7


@given(st.integers(-2047, 2047), st.integers(-32767, 32767), st.integers(-(2**31), 2**31 - 1))
@settings(max_examples=30)
def test_signs_are_bits_or_complements(offset: int, position: int, turns: int) -> None:
    assert FEETECH.homing_offset.decoded(FEETECH.homing_offset.encoded(offset)) == offset
    assert FEETECH.position.decoded(FEETECH.position.encoded(position)) == position
    assert DYNAMIXEL.position.decoded(DYNAMIXEL.position.encoded(turns)) == turns


def test_worked_signs() -> None:
    assert FEETECH.homing_offset.encoded(-1) == b"\x01\x08"
    assert FEETECH.position.decoded(b"\x05\x80") == -5
    assert DYNAMIXEL.homing_offset.encoded(-1) == b"\xff" * 4
    with pytest.raises(OverflowError, match="11 bits"):
        FEETECH.homing_offset.encoded(2048)
