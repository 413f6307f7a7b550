"""Worked bytes of every request and reply, read at every split, with errors and garbage."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.extensions.real_arm.codec import replies, requests
from katana450.extensions.real_arm.codec.codecs import (
    FirmwareCodec,
    FirmwareEvent,
    HostCodec,
    OutOfStepError,
    RequestInvalid,
    crc16,
    reply_bytes,
    request_bytes,
    with_crc,
)
from katana450.extensions.real_arm.codec.replies import (
    CRC_ERROR,
    INVALID_ARGUMENT,
    AxisStatus,
    status_words,
)
from tests.conftest import LONG

IDENTITY = replies.ArmIdentity(b"Katana450".ljust(81))
HOLD = requests.AxisSegment(10, 30500, 30500, 0, 0, 0)
SENSORS = replies.SensorBytes(15, tuple(range(16)))

# (request, its bytes, reply, its bytes); None where the source gives none.
WORKED = [
    (
        requests.ReadMasterVersion(),
        "01 18 01 42 31 80",
        replies.MasterVersion(2, 1),
        "62 02 01 7E 61",
    ),
    (requests.ReadArmIdentity(), "01 18 01 59 3A C0", IDENTITY, None),
    (
        requests.ReadSlaveVersion(1),
        "01 18 03 56 01 20 58 E0",
        replies.SlaveVersion(1, 32, 2, 1, 0, 0, 0),
        "76 01 20 02 01 00 00 00 00 00 00 00 00 AF 4C",
    ),
    (
        requests.ReadAxis(1),
        "01 18 02 44 01 C0 F2",
        replies.AxisReading(1, 4, 0, 0, 70),
        "64 01 04 00 00 00 00 46 6D 97",
    ),
    (
        requests.ReadPositions(),
        "01 18 03 4E 03 00 E7 60",
        replies.AxisPositions((30500, -30500, -30500, 30500, 30500, 30500)),
        "6E 77 24 88 DC 88 DC 77 24 77 24 77 24 72 C1",
    ),
    (
        requests.ReadStates(),
        "01 18 03 4E 01 00 87 61",
        replies.AxisStates((8, 8, 8, 8, 8, 8)),
        "6E 08 08 08 08 08 08 00 00 00 00 00 00 DD 32",
    ),
    (
        requests.CommandMotor(requests.ALL_AXES, requests.MotorFlag.FLUSH, 0),
        "01 18 05 43 00 20 00 00 05 44",
        replies.MotorCommanded(0, 32),
        "63 00 20 C6 F1",
    ),
    (
        requests.CommandMotor(requests.ALL_AXES, requests.MotorFlag.CALIBRATE, 32000),
        "01 18 05 43 00 04 7D 00 5E 25",
        replies.MotorCommanded(0, 4),
        "63 00 04 DD F1",
    ),
    (
        requests.CommandMotor(2, requests.MotorFlag.MOVE, -10000),
        "01 18 05 43 02 18 D8 F0 34 9E",
        replies.MotorCommanded(2, 24),
        None,
    ),
    (
        requests.CommandMotor(1, requests.MotorFlag.FREEZE, 30500),
        "01 18 05 43 01 08 77 24 1A E2",
        replies.MotorCommanded(1, 8),
        "63 01 08 48 F0",
    ),
    (
        requests.SetAxisParameter(1, 3, 180, 180),
        "01 18 06 53 01 03 B4 B4 00 C1 06",
        replies.AxisParameters(1, 3, 180, 180, 0),
        "73 01 03 B4 B4 00 A1 01",
    ),
    (
        requests.SetCollisionDetection(1),
        "01 18 03 41 00 01 D4 91",
        replies.CollisionDetectionSet(),
        "61 00 90 29",
    ),
    (
        requests.SetCollisionDetection(0),
        "01 18 03 41 00 00 14 50",
        replies.CollisionDetectionSet(),
        "61 00 90 29",
    ),
    (requests.ReadSensors(), "01 18 02 45 0F 94 72", SENSORS, None),
    (
        requests.SendSplines((HOLD,) * 6, requests.More.STORE),
        None,
        replies.SplinesSent(),
        "68 02 01 7C 41",
    ),
]

PAIRS: list[tuple[requests.ArmRequest, replies.ArmReply]] = [
    *((request, reply) for request, _, reply, _ in WORKED),
    (requests.ErrorQuery(), replies.FirmwareError(ord("H"), -1, 1, "move buffer error")),
]

REFUSAL = reply_bytes(replies.RefusedReply())


def test_checksum_has_its_published_check_value() -> None:
    assert crc16(b"123456789") == 0xBB3D


def test_worked_bytes_are_written() -> None:
    assert bytes.fromhex("C0 50 00") == REFUSAL
    for request, sent, reply, received in WORKED:
        if sent is not None:
            assert request_bytes(request) == bytes.fromhex(sent), request
        if received is not None:
            assert reply_bytes(reply) == bytes.fromhex(received), reply


def test_every_request_and_reply_is_tested() -> None:
    tested = {type(request) for request, _ in PAIRS}
    assert tested == {*requests.REQUESTS, requests.ErrorQuery}
    assert {request.REPLY for request in tested} == {type(reply) for _, reply in PAIRS}


def test_lengths_are_those_of_the_protocol() -> None:
    lengths = {
        (request.HEAD[:1], len(request.payload), len(reply.payload))
        for request, reply in PAIRS
        if not isinstance(request, requests.ErrorQuery)
    }
    assert lengths == {
        (b"B", 1, 3), (b"Y", 1, 84), (b"V", 3, 13), (b"D", 2, 8), (b"N", 3, 13),
        (b"C", 5, 3), (b"S", 6, 6), (b"A", 3, 2), (b"E", 2, 18), (b"H", 75, 3),
    }  # fmt: skip


def test_error_is_flagged_then_fetched_by_four_raw_bytes() -> None:
    host, arm = HostCodec(), FirmwareCodec()
    packet = requests.SendSplines((HOLD,) * 6, requests.More.LAST)
    arm.receive(host.send(packet))
    assert host.receive(REFUSAL) == replies.RefusedReply()
    query = host.send(requests.ErrorQuery())
    assert query == bytes.fromhex("00 00 00 C1")
    assert arm.receive(query) == [requests.ErrorQuery()]
    error = replies.FirmwareError(ord("H"), -10, 30, "StopperThread: collision on axis: 1")
    assert len(reply_bytes(error)) == 57
    assert host.receive(reply_bytes(error)) == error
    assert error.sentence == (
        "The arm refused a request (polynomials): the axis collided "
        "('StopperThread: collision on axis: 1')."
    )


@pytest.mark.parametrize("length", [1, 18, 50, 51])
def test_error_texts_of_all_lengths_are_read(length: int) -> None:
    text = b"move buffer error"[: length - 1].ljust(length, b"\0")
    payload = b"\xc1" + b"H\xff\x01" + text
    host = HostCodec()
    host.send(requests.ErrorQuery())
    reply = payload + crc16(payload).to_bytes(2, "big")
    expected = replies.FirmwareError(ord("H"), -1, 1, text.rstrip(b"\0").decode())
    assert host.receive(reply) == expected


@pytest.mark.parametrize(
    ("request_", "reply", "confirmed"),
    [
        (requests.ReadAxis(2), replies.AxisReading(0, 0, 0, 0, 0), False),
        (requests.ReadAxis(2), replies.AxisReading(2, 8, 0, 0, 0), True),
        (requests.CommandMotor(0, 32, 0), replies.MotorCommanded(0, 32), True),
        (requests.CommandMotor(3, 8, 0), replies.MotorCommanded(0, 8), False),
        (requests.ReadSensors(), replies.SensorBytes(0, (0,) * 16), False),
        (requests.ReadPositions(), replies.AxisPositions((0,) * 6), True),
    ],
)
def test_axis_0_in_a_reply_means_failure(
    request_: requests.ArmRequest, reply: replies.ArmReply, confirmed: bool
) -> None:
    assert request_.is_confirmed_by(reply) is confirmed


EXAMPLES = 300 if LONG else 25
STREAM = b"".join(request_bytes(request) for request, _ in PAIRS)


def frame(payload: bytes) -> bytes:
    return bytes((1, 24, len(payload))) + with_crc(payload)


def split_at(data: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted(cut % (len(data) + 1) for cut in cuts)
    return [data[a:b] for a, b in zip([0, *ends], [*ends, len(data)], strict=True)]


OUT_OF_STEP = "out of step"


def received(request: requests.ArmRequest, parts: list[bytes]) -> list[replies.ArmReply | str]:
    """Return the reply in ``parts``, if it is complete, or OUT_OF_STEP."""
    host = HostCodec()
    host.send(request)
    try:
        answers = [host.receive(part) for part in parts]
    except OutOfStepError:
        return [OUT_OF_STEP]
    return [reply for reply in answers if reply is not None]


def firmware_events(parts: list[bytes]) -> list[FirmwareEvent]:
    codec = FirmwareCodec()
    return [event for part in parts for event in codec.receive(part)]


@pytest.mark.parametrize(("request_", "reply"), PAIRS)
def test_request_reply_and_refusal_are_read_at_every_split(
    request_: requests.ArmRequest, reply: replies.ArmReply
) -> None:
    read_reply: Callable[[list[bytes]], Sequence[object]] = partial(received, request_)
    for data, read, event in (
        (request_bytes(request_), firmware_events, request_),
        (reply_bytes(reply), read_reply, reply),
        (REFUSAL, read_reply, replies.RefusedReply()),
    ):
        for cut in range(len(data) + 1):
            assert read([data[:cut], data[cut:]]) == [event]
        assert read([bytes((byte,)) for byte in data]) == [event]
        assert read([data[:-1]]) == []


@settings(max_examples=EXAMPLES)
@given(st.lists(st.integers(0, len(STREAM)), max_size=40))
def test_requests_are_read_at_every_split(cuts: list[int]) -> None:
    assert firmware_events(split_at(STREAM, cuts)) == [request for request, _ in PAIRS]


@settings(max_examples=EXAMPLES)
@given(st.binary(max_size=300), st.lists(st.integers(0, 300), max_size=8))
def test_garbage_gives_the_same_events_at_every_split(data: bytes, cuts: list[int]) -> None:
    parts = split_at(data, cuts)
    assert firmware_events(parts) == firmware_events([data])
    for request in (requests.ReadPositions(), requests.ErrorQuery()):
        assert received(request, parts) == received(request, [data])


@settings(max_examples=EXAMPLES)
@given(st.binary(min_size=1, max_size=40))
def test_requests_after_garbage_without_a_start_are_read(data: bytes) -> None:
    garbage = data.replace(b"\x01", b"\x02").replace(b"\x00", b"\x02")
    events = firmware_events([garbage + request_bytes(requests.ReadStates())])
    assert events == [requests.ReadStates()]


@settings(max_examples=EXAMPLES)
@given(st.integers(0, len(PAIRS) - 1), st.integers(0, 400), st.integers(1, 255))
def test_changed_byte_of_a_reply_is_never_taken_for_one(
    which: int, place: int, change: int
) -> None:
    request, reply = PAIRS[which]
    data = bytearray(reply_bytes(reply))
    data[place % len(data)] ^= change
    assert received(request, [bytes(data)]) in ([], [OUT_OF_STEP])


def test_wrong_checksum_of_a_request_is_reported_and_the_next_request_is_read() -> None:
    wrong = bytearray(request_bytes(requests.ReadAxis(3)))
    wrong[-1] ^= 1
    assert firmware_events([bytes(wrong) + request_bytes(requests.ReadStates())]) == [
        RequestInvalid(b"D\x03", CRC_ERROR),
        requests.ReadStates(),
    ]


@pytest.mark.parametrize(
    "payload", [b"", b"Q", b"N\x07\x00", b"D", b"D\x01\x02", b"T?\x00\x00\x00"]
)
def test_unknown_request_is_reported(payload: bytes) -> None:
    assert firmware_events([frame(payload)]) == [RequestInvalid(payload, INVALID_ARGUMENT)]


def test_bytes_beside_one_reply_put_the_host_out_of_step() -> None:
    request, data = requests.ReadMasterVersion(), reply_bytes(replies.MasterVersion(2, 1))
    with pytest.raises(OutOfStepError, match="no request waits"):
        HostCodec().receive(data)
    assert received(request, [data + data]) == received(request, [data, data]) == [OUT_OF_STEP]


def test_host_sends_one_request_at_a_time_whose_numbers_fit() -> None:
    host = HostCodec()
    with pytest.raises(InputError, match="does not fit"):
        host.send(requests.CommandMotor(1, 24, 32768))
    host.send(requests.ReadStates())
    with pytest.raises(InputError, match="one request at a time"):
        host.send(requests.ReadStates())


def test_unknown_status_is_said_to_be_unknown() -> None:
    assert status_words(AxisStatus.COLLIDED) == "a collision stopped it"
    assert status_words(77) == "it reports the unknown status 77"


FUZZED = pytest.param(1_000_000, marks=pytest.mark.long)


@pytest.mark.parametrize("count", [40_000, FUZZED])
def test_fuzzed_bytes_raise_nothing_and_give_no_wrong_event(count: int) -> None:
    rng = random.Random(count)
    arm = FirmwareCodec()
    # A second source of bytes looks like the protocol, so that the fuzz reaches all of the codec.
    likely = [reply_bytes(reply) for _, reply in PAIRS] + [STREAM, REFUSAL, b"\0\0\0\xc1"]
    done = events = 0
    received_bytes = b""
    while done < count:
        data = bytearray(rng.choice(likely) if rng.random() < 0.5 else rng.randbytes(64))
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        # Longer than any request and what may precede it.
        received_bytes = (received_bytes + data)[-4096:]
        for event in arm.receive(bytes(data)):
            if isinstance(event, requests.ArmRequest):
                events += 1
                assert firmware_events([request_bytes(event)]) == [event]
                assert event.payload in received_bytes
        request, _ = rng.choice(PAIRS)
        for reply in received(request, [bytes(data)]):
            if isinstance(reply, replies.ArmReply):
                length = len(reply.payload)
                assert with_crc(bytes(data[:length])) == data[: length + 2]
        done += len(data)
    assert events
