"""The driver with its thread and a real connection: prompt calls, faults, no repeated motion."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pytest

from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.errors import InputError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.codec import requests
from katana450.extensions.real_arm.codec.codecs import reply_bytes
from katana450.extensions.real_arm.codec.replies import FirmwareError, RefusedReply
from katana450.extensions.real_arm.driver.katana_driver import KatanaDriver
from katana450.extensions.real_arm.driver.machine import ArmMachine
from tests.real_arm.control_loop import SmallLoop, swing
from tests.real_arm.paper_arm import ENDS, JOINTS, PaperArm
from tests.real_arm.small_firmware import Piece, SmallFirmware
from tests.waiting import until


class PaperServer:
    """The arm on paper behind a port. ``faults`` are the pieces of the next replies instead."""

    def __init__(self) -> None:
        self.arm = PaperArm()
        self.delay = 0.0
        self.faults: list[Sequence[Piece]] = []
        self._refused: FirmwareError | None = None

    def answer(self, request: requests.ArmRequest) -> Sequence[Piece]:
        if isinstance(request, requests.ErrorQuery) and self._refused is not None:
            return (reply_bytes(self._refused),)
        reply = self.arm.answer(request, time.perf_counter())
        if self.faults:
            return self.faults.pop(0)
        if isinstance(reply, FirmwareError):
            self._refused = reply
            return (reply_bytes(RefusedReply()),)
        return (self.delay, reply_bytes(reply)) if self.delay else (reply_bytes(reply),)


@contextmanager
def served() -> Iterator[tuple[PaperServer, SmallFirmware, SmallLoop]]:
    paper = PaperServer()
    with SmallFirmware(paper.answer) as firmware:
        loop = SmallLoop(KatanaDriver(DeviceAddress("127.0.0.1", firmware.port), ENDS, JOINTS))
        try:
            yield paper, firmware, loop
        finally:
            loop.end()


def orders(arm: PaperArm) -> list[requests.ArmRequest]:
    """Return all requests that move the arm, in their order."""
    return [
        request
        for _, request in arm.requests
        if isinstance(request, requests.SendSplines)
        or (isinstance(request, requests.CommandMotor) and request.flag in (4, 24, 0))
    ]


@pytest.mark.cases(2)
@pytest.mark.parametrize("fault", ["silence", "reset", "garbage", "half"])
def test_loss_is_reported_in_half_a_second_and_nothing_is_repeated(fault: str) -> None:
    pieces: dict[str, Sequence[Piece]] = {
        "silence": (1.0,), "reset": (None,), "garbage": (b"\x6e" * 20,), "half": (b"\x6e\x01",),
    }  # fmt: skip
    with served() as (paper, firmware, loop):
        loop.engage()
        loop.setpoint = swing(JOINTS, time.perf_counter())
        time.sleep(1.0)
        paper.faults = [pieces[fault]]
        assert loop.wait(ArmMode.LOST) < 0.5
        until(lambda: "Trying to connect again" in loop.report.note)
        sent = orders(paper.arm)
        loop.wait(ArmMode.UNCALIBRATED)
        assert "Connected again" in loop.report.note
        time.sleep(0.5)
        assert orders(paper.arm) == sent
        assert firmware.connections >= 2
        loop.stop()
        loop.engage()
        time.sleep(0.1)
        assert orders(paper.arm) == sent


def test_arm_that_hangs_never_delays_the_loop() -> None:
    with served() as (paper, _, loop):
        loop.engage()
        loop.setpoint = swing(JOINTS, time.perf_counter())
        time.sleep(0.3)
        paper.faults = [(5.0,)]
        loop.longest = 0.0
        loop.wait(ArmMode.LOST)
        time.sleep(0.5)
        # The system accepts another connection meanwhile, but no arm answers there.
        assert loop.report.mode is ArmMode.LOST
        assert loop.longest < 0.03


def test_thread_that_hangs_is_reported_by_send(monkeypatch: pytest.MonkeyPatch) -> None:
    with served() as (_, _, loop):
        loop.engage()
        driver = loop.driver
        assert isinstance(driver, KatanaDriver)
        delays, turn = iter([1.2]), driver._turn

        def late_turn() -> None:
            time.sleep(next(delays, 0.0))
            turn()

        monkeypatch.setattr(driver, "_turn", late_turn)
        # Counted from the request before, which was sent up to two polls earlier.
        assert 0.2 < loop.wait(ArmMode.LOST) < 0.5
        assert "has not heard" in loop.report.note
        loop.wait(ArmMode.HOLDING)


def test_no_arm_at_the_address_is_reported_until_a_person_connects_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    loop = SmallLoop(KatanaDriver(DeviceAddress("127.0.0.1", port), ENDS, JOINTS))
    try:
        loop.driver.perform(ArmAct.CONNECT, 0.0)
        time.sleep(0.3)
        assert loop.report.mode is ArmMode.DISCONNECTED
        assert f"no connection to the arm at 127.0.0.1, port {port}" in loop.report.note
        paper = PaperServer()
        with SmallFirmware(paper.answer, port) as firmware:
            time.sleep(0.5)
            assert firmware.connections == 0
            loop.act(ArmAct.CONNECT, ArmMode.UNCALIBRATED)
            loop.act(ArmAct.DISCONNECT, ArmMode.DISCONNECTED)
    finally:
        loop.end()


def test_end_of_the_program_stops_a_moving_arm() -> None:
    with served() as (paper, _, loop):
        loop.engage()
        loop.setpoint = swing(JOINTS, time.perf_counter())
        time.sleep(1.0)
        assert loop.report.mode is ArmMode.MOVING
        loop.driver.stop()
        flags = [r.flag for _, r in paper.arm.requests if isinstance(r, requests.CommandMotor)]
        assert flags[-6:] == [32, 8, 8, 8, 8, 8]


def test_internal_error_is_a_loss_and_does_not_end_the_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with served() as (_, _, loop):
        loop.engage()
        broken = iter([True])

        def urgent(machine: ArmMachine, now: float) -> requests.ArmRequest | None:
            if next(broken, False):
                raise ArithmeticError("a fault of the test")
            return before(machine, now)

        before = ArmMachine.urgent
        monkeypatch.setattr(ArmMachine, "urgent", urgent)
        loop.wait(ArmMode.LOST)
        assert "internal error: a fault of the test" in loop.report.note
        loop.wait(ArmMode.UNCALIBRATED)


def test_setpoint_that_is_not_finite_is_refused() -> None:
    driver = KatanaDriver(DeviceAddress("127.0.0.1", 1), ENDS, JOINTS)
    with pytest.raises(InputError, match="must be finite"):
        driver.send(np.full(5, np.nan), 0.0, 0.0)
    driver.stop()
