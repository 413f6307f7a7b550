"""Exchanges over real sockets and a real serial device: complete, or lost within their deadline."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

from katana450.errors import InputError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.codec import replies, requests
from katana450.extensions.real_arm.codec.codecs import (
    FirmwareCodec,
    reply_bytes,
    with_crc,
)
from katana450.extensions.real_arm.link import (
    PORT,
    ArmLink,
    ArmRefusalError,
    LinkLostError,
    open_arm,
)
from tests.real_arm.small_firmware import Piece, SmallFirmware

POSITIONS = replies.AxisPositions((1, -2, 3, -4, 5, -6))
REPLY = reply_bytes(POSITIONS)
ERROR = replies.FirmwareError(ord("N"), -10, 2, "StopperThread: collision")


@contextmanager
def link_to(*pieces: Piece) -> Iterator[tuple[ArmLink, SmallFirmware]]:
    """Yield a link to an arm that answers each request with ``pieces``."""

    def answer(request: requests.ArmRequest) -> Sequence[Piece]:
        return (reply_bytes(ERROR),) if isinstance(request, requests.ErrorQuery) else pieces

    with SmallFirmware(answer) as firmware:
        link = ArmLink(open_arm(DeviceAddress("127.0.0.1", firmware.port)))
        try:
            yield link, firmware
        finally:
            link.close()


def test_reply_in_pieces_is_complete() -> None:
    pieces: list[Piece] = []
    for byte in REPLY:
        pieces += [bytes((byte,)), 0.003]
    with link_to(*pieces) as (link, _):
        assert link.exchange(requests.ReadPositions()) == POSITIONS


def test_refusal_comes_with_its_reason_and_the_link_remains() -> None:
    with link_to(reply_bytes(replies.RefusedReply())) as (link, firmware):
        for _ in range(2):
            with pytest.raises(ArmRefusalError, match=r"axis 2\): the axis collided") as refused:
                link.exchange(requests.ReadPositions())
            assert refused.value.error == ERROR
        assert firmware.connections == 1


def test_reply_that_names_no_axis_is_a_refusal() -> None:
    reply = reply_bytes(replies.AxisReading(0, 0, 0, 0, 0))
    with link_to(reply) as (link, _), pytest.raises(ArmRefusalError, match="no axis confirmed"):
        link.exchange(requests.ReadAxis(3))


FAULTS: dict[str, tuple[tuple[Piece, ...], str]] = {
    "silence": ((), "does not answer"),
    "half a reply": ((REPLY[:6],), "does not answer"),
    "slow bytes": ((REPLY[:6], 0.3, REPLY[6:]), "does not answer"),
    "reset": ((None,), "broke|closed"),
    "half a reply, then a reset": ((REPLY[:6], None), "broke|closed"),
    "wrong checksum": ((REPLY[:-1] + b"\0",), "checksum"),
    "another reply": ((reply_bytes(replies.MasterVersion(2, 1)),), "begins otherwise"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_loses_the_link_within_the_deadline_and_repeats_nothing(fault: str) -> None:
    pieces, problem = FAULTS[fault]
    with link_to(*pieces) as (link, firmware):
        start = time.perf_counter()
        with pytest.raises(LinkLostError, match=problem):
            link.exchange(requests.ReadPositions(), 0.2)
        assert time.perf_counter() - start < 0.3
        time.sleep(0.02)
        assert firmware.requests == [requests.ReadPositions()]
        with pytest.raises(LinkLostError, match="connect again"):
            link.exchange(requests.ReadPositions())


def test_bytes_without_a_request_are_found_before_the_next_one_is_sent() -> None:
    with link_to(REPLY, 0.01, b"\x7a") as (link, firmware):
        link.exchange(requests.ReadPositions())
        time.sleep(0.05)
        with pytest.raises(LinkLostError, match="without a request"):
            link.exchange(requests.CommandMotor(1, requests.MotorFlag.MOVE, 0))
        assert firmware.requests == [requests.ReadPositions()]


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("tcp://192.168.1.1", DeviceAddress("192.168.1.1", 5566)),
        ("tcp://katana:99", DeviceAddress("katana", 99)),
        ("tcp://[::1]:99", DeviceAddress("::1", 99)),
        ("serial:///dev/ttyUSB0", DeviceAddress("/dev/ttyUSB0", None)),
        ("serial://COM3", DeviceAddress("COM3", None)),
        ("/dev/ttyACM0", DeviceAddress("/dev/ttyACM0", None)),
        ("COM12", DeviceAddress("COM12", None)),
    ],
)
def test_address_is_read_and_shown(text: str, url: DeviceAddress) -> None:
    assert DeviceAddress.parse(text, PORT) == url
    assert DeviceAddress.parse(str(url), PORT) == url


@pytest.mark.parametrize(
    "text",
    ["", "192.168.1.1", "tcp://", "tcp://a:b", "tcp://a:0", "udp://a", "tcp://a/b", "serial://"],
)
def test_other_address_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="not the address of a device"):
        DeviceAddress.parse(text, PORT)


def test_serial_device_is_used_like_a_socket() -> None:
    pty, tty = pytest.importorskip("pty"), pytest.importorskip("tty")
    master, slave = pty.openpty()
    tty.setraw(master)

    def serve() -> None:
        codec = FirmwareCodec()
        while True:
            try:
                data = os.read(master, 100)
            except OSError:
                return
            for event in codec.receive(data):
                if isinstance(event, requests.ReadPositions):
                    os.write(master, REPLY[:5])
                    os.write(master, REPLY[5:])

    threading.Thread(target=serve, daemon=True).start()
    link = ArmLink(open_arm(DeviceAddress(os.ttyname(slave), None)))
    try:
        # Noise before a request is dropped.
        os.write(master, with_crc(b"z"))
        for _ in range(5):
            assert link.exchange(requests.ReadPositions()) == POSITIONS
        with pytest.raises(LinkLostError, match="does not answer"):
            link.exchange(requests.ReadStates(), 0.1)
    finally:
        link.close()
        os.close(slave)
        os.close(master)


def test_serial_device_that_does_not_exist_is_reported() -> None:
    with pytest.raises(LinkLostError, match="cannot be opened"):
        open_arm(DeviceAddress("/dev/no-such-device", None))


def test_unplugged_serial_device_is_reported() -> None:
    pty = pytest.importorskip("pty")
    master, slave = pty.openpty()
    port = open_arm(DeviceAddress(os.ttyname(slave), None))
    os.close(slave)
    os.close(master)
    with pytest.raises(LinkLostError, match="connection to the arm is lost"):
        port.write(b"z", 0.1)
    with pytest.raises(LinkLostError, match="connection to the arm is lost"):
        port.read(0.1)
    port.close()
