"""The codec survives every split of the stream, garbage and truncation."""

from __future__ import annotations

import random
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.extensions.real_arm.codec import replies, requests
from katana450.extensions.real_arm.codec.axis_status import AxisStatus, status_words
from katana450.extensions.real_arm.codec.crc import with_crc
from katana450.extensions.real_arm.codec.error_codes import CRC_ERROR, INVALID_ARGUMENT
from katana450.extensions.real_arm.codec.firmware_codec import (
    FirmwareCodec,
    FirmwareEvent,
    RequestInvalid,
    RequestReceived,
    refusal_bytes,
    reply_bytes,
)
from katana450.extensions.real_arm.codec.host_codec import (
    HostCodec,
    HostEvent,
    OutOfStep,
    ReplyReceived,
    RequestRefused,
    request_bytes,
)
from tests.conftest import LONG
from tests.real_arm.test_worked_bytes import PAIRS

EXAMPLES = 300 if LONG else 25
STREAM = b"".join(request_bytes(request) for request, _ in PAIRS)


def frame(payload: bytes) -> bytes:
    return bytes((1, 24, len(payload))) + with_crc(payload)


def split_at(data: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted(cut % (len(data) + 1) for cut in cuts)
    return [data[a:b] for a, b in zip([0, *ends], [*ends, len(data)], strict=True)]


def host_events(request: requests.ArmRequest, parts: list[bytes]) -> list[HostEvent]:
    host = HostCodec()
    host.send(request)
    return [event for part in parts for event in host.receive(part)]


def firmware_events(parts: list[bytes]) -> list[FirmwareEvent]:
    codec = FirmwareCodec()
    return [event for part in parts for event in codec.receive(part)]


@pytest.mark.parametrize(("request_", "reply"), PAIRS)
def test_reply_is_read_at_every_split(
    request_: requests.ArmRequest, reply: replies.ArmReply
) -> None:
    data = reply_bytes(reply)
    for cut in range(len(data) + 1):
        parts = [data[:cut], data[cut:]]
        assert host_events(request_, parts) == [ReplyReceived(request_, reply)]
    assert host_events(request_, [bytes((byte,)) for byte in data]) == [
        ReplyReceived(request_, reply)
    ]
    assert host_events(request_, [data[:-1]]) == []


@pytest.mark.parametrize("request_", [request for request, _ in PAIRS])
def test_request_and_refusal_are_read_at_every_split(request_: requests.ArmRequest) -> None:
    address = 0 if isinstance(request_, requests.ErrorQuery) else 24
    for data, read, found in (
        (request_bytes(request_), firmware_events, RequestReceived(request_, address)),
        (refusal_bytes(), partial(host_events, request_), RequestRefused(request_)),
    ):
        for cut in range(len(data) + 1):
            assert read([data[:cut], data[cut:]]) == [found]
        assert read([bytes((byte,)) for byte in data]) == [found]
        assert read([data[:-1]]) == []


@settings(max_examples=EXAMPLES)
@given(st.lists(st.integers(0, len(STREAM)), max_size=40))
def test_requests_are_read_at_every_split(cuts: list[int]) -> None:
    expected = [
        RequestReceived(request, 0 if isinstance(request, requests.ErrorQuery) else 24)
        for request, _ in PAIRS
    ]
    assert firmware_events(split_at(STREAM, cuts)) == expected


@settings(max_examples=EXAMPLES)
@given(st.binary(max_size=300), st.lists(st.integers(0, 300), max_size=8))
def test_garbage_gives_the_same_events_at_every_split(data: bytes, cuts: list[int]) -> None:
    parts = split_at(data, cuts)
    assert firmware_events(parts) == firmware_events([data])
    for request in (requests.ReadPositions(), requests.ErrorQuery()):
        assert host_events(request, parts) == host_events(request, [data])


@settings(max_examples=EXAMPLES)
@given(st.binary(min_size=1, max_size=40))
def test_requests_after_garbage_without_a_start_are_read(data: bytes) -> None:
    garbage = data.replace(b"\x01", b"\x02").replace(b"\x00", b"\x02")
    events = firmware_events([garbage + request_bytes(requests.ReadStates())])
    assert events == [RequestReceived(requests.ReadStates(), 24)]


@settings(max_examples=EXAMPLES)
@given(st.integers(0, len(PAIRS) - 1), st.integers(0, 400), st.integers(1, 255))
def test_changed_byte_of_a_reply_is_never_taken_for_one(
    which: int, place: int, change: int
) -> None:
    request, reply = PAIRS[which]
    data = bytearray(reply_bytes(reply))
    data[place % len(data)] ^= change
    for event in host_events(request, [bytes(data)]):
        assert isinstance(event, OutOfStep)


def test_wrong_checksum_of_a_request_is_reported_and_the_next_request_is_read() -> None:
    wrong = bytearray(request_bytes(requests.ReadAxis(3)))
    wrong[-1] ^= 1
    assert firmware_events([bytes(wrong) + request_bytes(requests.EchoRequest())]) == [
        RequestInvalid(b"D\x03", CRC_ERROR),
        RequestReceived(requests.EchoRequest(), 24),
    ]


@pytest.mark.parametrize(
    "payload", [b"", b"Q", b"N\x07\x00", b"D", b"D\x01\x02", b"T?\x00\x00\x00"]
)
def test_unknown_request_is_reported(payload: bytes) -> None:
    assert firmware_events([frame(payload)]) == [RequestInvalid(payload, INVALID_ARGUMENT)]


def test_bytes_without_a_request_put_the_host_out_of_step() -> None:
    host = HostCodec()
    (event,) = host.receive(reply_bytes(replies.EchoReply()))
    assert isinstance(event, OutOfStep)
    assert host.receive(b"more") == []
    with pytest.raises(InputError, match="connect again"):
        host.send(requests.EchoRequest())


def test_bytes_after_a_reply_put_the_host_out_of_step() -> None:
    data = reply_bytes(replies.EchoReply())
    first, second = host_events(requests.EchoRequest(), [data + data])
    assert first == ReplyReceived(requests.EchoRequest(), replies.EchoReply())
    assert isinstance(second, OutOfStep)


def test_second_request_before_the_reply_is_refused() -> None:
    host = HostCodec()
    host.send(requests.EchoRequest())
    with pytest.raises(InputError, match="one request at a time"):
        host.send(requests.EchoRequest())


def test_numbers_that_do_not_fit_are_refused_and_leave_the_codec_usable() -> None:
    host = HostCodec()
    with pytest.raises(InputError, match="does not fit"):
        host.send(requests.CommandMotor(1, 24, 32768))
    assert host.send(requests.EchoRequest())


def test_unknown_status_is_said_to_be_unknown() -> None:
    assert status_words(AxisStatus.COLLIDED) == "a collision stopped it"
    assert status_words(77) == "it reports the unknown status 77"


FUZZED = pytest.param(1_000_000, marks=pytest.mark.long)


@pytest.mark.parametrize("count", [40_000, FUZZED])
def test_fuzzed_bytes_raise_nothing_and_give_no_wrong_event(count: int) -> None:
    rng = random.Random(count)
    arm = FirmwareCodec()
    # A second source of bytes looks like the protocol, so that the fuzz reaches all of the codec.
    likely = [reply_bytes(reply) for _, reply in PAIRS] + [STREAM, refusal_bytes(), b"\0\0\0\xc1"]
    done = found = 0
    received_bytes = b""
    while done < count:
        data = bytearray(rng.choice(likely) if rng.random() < 0.5 else rng.randbytes(64))
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        # Longer than any request and what may precede it.
        received_bytes = (received_bytes + data)[-4096:]
        for event in arm.receive(bytes(data)):
            if isinstance(event, RequestReceived):
                found += 1
                sent = request_bytes(event.request, event.address)
                assert firmware_events([sent]) == [event]
                assert sent in received_bytes
        request, _ = rng.choice(PAIRS)
        for received in host_events(request, [bytes(data)]):
            if isinstance(received, ReplyReceived):
                length = len(received.reply.payload)
                assert with_crc(bytes(data[:length])) == data[: length + 2]
        done += len(data)
    assert found
