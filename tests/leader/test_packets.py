"""Packets of the servo bus: worked bytes, every split, garbage."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.extensions.motor_bus import packets as motor_bus
from katana450.extensions.motor_bus.packets import (
    HOMING_OFFSET,
    PRESENT_POSITION,
    TORQUE_ENABLE,
    Packet,
    PacketReader,
)

WORKED = (
    # The first two are examples of Feetech's protocol manual.
    (motor_bus.ping_request(1), "ff ff 01 02 01 fb"),
    (motor_bus.read_request(1, PRESENT_POSITION), "ff ff 01 04 02 38 02 be"),
    (motor_bus.write_request(1, TORQUE_ENABLE, 0), "ff ff 01 04 03 28 00 cf"),
    (motor_bus.sync_read_request((1, 2), 56, 8), "ff ff fe 06 82 38 08 01 02 36"),
    (Packet(1, 0, bytes((0x18, 0x05))), "ff ff 01 04 00 18 05 dd"),
)


@pytest.mark.parametrize(("packet", "text"), WORKED)
def test_worked_bytes(packet: Packet, text: str) -> None:
    data = bytes.fromhex(text)
    assert packet.encoded == data
    for place in range(len(data) + 1):
        reader = PacketReader()
        assert reader.feed(data[:place]) + reader.feed(data[place:]) == [packet]


def test_packets_are_found_in_any_split_of_a_stream_with_garbage() -> None:
    random.seed(7)
    expected = [packet for packet, _ in WORKED] * 20
    # Garbage without the first byte of a header, and headers that begin nothing.
    noise = [bytes(random.randrange(0xFF) for _ in range(5)), b"\xff\xff\xff", b"\xff\xff\x01\x00"]
    stream = b"".join(random.choice(noise) + packet.encoded for packet in expected)
    for _ in range(50):
        reader, packets, place = PacketReader(), [], 0
        while place < len(stream):
            end = place + random.randint(1, 9)
            packets += reader.feed(stream[place:end])
            place = end
        assert packets == expected


def test_wrong_checksum_is_no_packet_and_hides_none() -> None:
    good = motor_bus.ping_request(3).encoded
    wrong = bytearray(motor_bus.read_request(2, PRESENT_POSITION).encoded)
    wrong[-1] ^= 0x10
    assert PacketReader().feed(bytes(wrong) + good) == [motor_bus.ping_request(3)]


@settings(max_examples=50)
@given(st.binary(max_size=400))
def test_any_bytes_raise_nothing_and_keep_little(data: bytes) -> None:
    reader = PacketReader()
    for packet in reader.feed(data):
        assert packet.encoded in data
    assert len(reader._rest) <= motor_bus.MAX_LENGTH + 4


@given(st.integers(-2047, 2047), st.integers(-32767, 32767))
@settings(max_examples=30)
def test_signs_are_bits(offset: int, position: int) -> None:
    assert HOMING_OFFSET.decoded(HOMING_OFFSET.encoded(offset)) == offset
    assert PRESENT_POSITION.decoded(PRESENT_POSITION.encoded(position)) == position


def test_worked_signs() -> None:
    assert HOMING_OFFSET.encoded(-1) == b"\x01\x08"
    assert PRESENT_POSITION.decoded(b"\x05\x80") == -5
    with pytest.raises(OverflowError, match="11 bits"):
        HOMING_OFFSET.encoded(2048)
