"""A real emulator process answers the worked exchanges of the protocol byte for byte."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.axis_status import AxisStatus
from tests.real_arm.emulated import emulator, exchanged, linked, raw

WORKED = [
    ("01 18 01 5A 3B 80", "7A E3 81"),
    ("01 18 01 42 31 80", "62 02 01 7E 61"),
    ("01 18 03 56 01 20 58 E0", "76 01 20 02 01 00 00 00 00 00 00 00 00 AF 4C"),
    ("01 18 03 4E 03 00 E7 60", "6E 77 24 88 DC 88 DC 77 24 77 24 77 24 72 C1"),
    ("01 18 03 4E 01 00 87 61", "6E 08 08 08 08 08 08 00 00 00 00 00 00 DD 32"),
    ("01 18 05 43 00 20 00 00 05 44", "63 00 20 C6 F1"),
    ("01 18 05 43 01 08 77 24 1A E2", "63 01 08 48 F0"),
    ("01 18 06 53 01 03 B4 B4 00 C1 06", "73 01 03 B4 B4 00 A1 01"),
    ("01 18 03 41 00 01 D4 91", "61 00 90 29"),
    ("01 18 03 41 00 00 14 50", "61 00 90 29"),
    ("01 18 05 54 72 00 00 00 B4 2A", "74 FD 81 E6"),
    ("01 18 05 43 00 04 7D 00 5E 25", "63 00 04 DD F1"),
]
"""Requests and replies, in an order that leaves the arm where the replies say it is."""


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with emulator("--calibrated", "--plant", "stiff", "--calibration-scale", "100") as port:
        yield port


def test_worked_exchanges_are_answered_byte_for_byte(port: int) -> None:
    with raw(port) as client:
        for request, reply in WORKED:
            assert exchanged(client, request) == reply


def test_replies_of_fixed_length_arrive_in_one_piece(port: int) -> None:
    with raw(port) as client:
        for request, letter, length in (
            ("01 18 01 59 3A C0", "79", 84),
            ("01 18 02 45 0F 94 72", "65", 18),
            ("01 18 02 44 01 C0 F2", "64", 8),
        ):
            reply = exchanged(client, request).split()
            assert (reply[0], len(reply)) == (letter, length + 2)


def test_error_is_fetched_by_four_raw_bytes(port: int) -> None:
    with raw(port) as client:
        assert exchanged(client, "01 18 01 5A 3B 81") == "C0 50 00"
        reason = bytes.fromhex(exchanged(client, "00 00 00 C1"))
        assert len(reason) == 4 + 51 + 2
        # -12, a wrong checksum, and no axis.
        assert reason[:4] == b"\xc1Z\xf4\x00"
        assert exchanged(client, "01 18 01 5A 3B 80") == "7A E3 81", "the link stays in step"


def test_request_may_come_in_pieces(port: int) -> None:
    with raw(port) as client:
        client.sendall(bytes.fromhex("01 18 01"))
        time.sleep(0.03)
        assert exchanged(client, "42 31 80") == "62 02 01 7E 61"


def test_second_client_waits_for_the_end_of_the_first(port: int) -> None:
    with raw(port) as first, raw(port) as second:
        assert exchanged(first, "01 18 01 5A 3B 80") == "7A E3 81"
        second.sendall(bytes.fromhex("01 18 01 5A 3B 80"))
        second.settimeout(0.1)
        with pytest.raises(TimeoutError):
            second.recv(16)
        first.close()
        second.settimeout(5.0)
        assert second.recv(16).hex() == "7ae381"


def test_client_may_poll_without_pause(port: int) -> None:
    with linked(port) as link:
        begun = time.monotonic()
        for _ in range(2000):
            link.exchange(req.ReadAxis(1))
        # 0.1 ms on an idle machine.
        assert time.monotonic() - begun < 8.0
        assert sorted(link.round_trips)[500] < 2e-3


def test_calibration_is_seen_by_polling_the_first_axis() -> None:
    options = ("--calibration-scale", "30", "--object", "40")
    with emulator(*options) as port, linked(port) as link:
        assert link.exchange(req.ReadSensors()).values[11] > 200  # type: ignore[attr-defined]
        link.exchange(req.SetCollisionDetection(0))
        link.exchange(req.CommandMotor(0, req.MotorFlag.CALIBRATE, 32000))
        begun, polls = time.monotonic(), 0
        while link.exchange(req.ReadAxis(1)).status == AxisStatus.CALIBRATING:  # type: ignore[attr-defined]
            polls += 1
            assert time.monotonic() - begun < 20.0
        assert polls > 10
        positions = link.exchange(req.ReadPositions()).positions  # type: ignore[attr-defined]
        assert all(abs(abs(each) - 30500) < 100 for each in positions)
