"""Test that silence is measured by the receipt of messages, on a test clock and real sockets."""

from __future__ import annotations

import socket
import struct
import sys
import time
from collections.abc import Iterator

import pytest

from katana450.arm.control.session import Session
from katana450.arm.control.stop_cause import StopCause
from katana450.arm.runtime.readiness import LAST_ACK_RECEIVED, ack_age, data_age
from katana450.server.service import status
from katana450.server.service.heartbeats import MAX_ACK_AGE, Arrival, LastHeartbeat, keep_alive
from katana450.server.service.hub import TICK
from katana450.server.service.stop_state import StopRecord
from katana450.settings import Settings
from tests.gateway.test_hub import PAGES, Table, moves

LATE = 0.2
"""Interval [s] of the checks of a delayed server, shorter than the heartbeat timeout."""


class Received(LastHeartbeat):
    """A connection whose newest message has a receipt time set by a test, and waits unhandled."""

    received = 0.0

    @property
    def newest(self) -> float:
        return self.received


@pytest.fixture
def table(session: Session) -> Table:
    return Table(session.begin(session.ready, 0.0, 0.0))


def test_silent_driver_is_stopped_by_a_server_that_is_always_late(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.touch(driver.person.key)
    table.arm.moves = True
    table.hub.tick()
    assert table.arm.beats == 1
    for _ in range(2):
        table.t += LATE
        table.hub.tick()
    assert not moves(table)
    # The second check came after the timeout, so the arm got a heartbeat at the first alone.
    assert table.arm.beats == 2


def test_arm_gets_no_heartbeat_for_a_silent_driver_at_rest(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.touch(driver.person.key)
    table.wait(Settings.silence - TICK)
    beats = table.arm.beats
    table.wait(5 * TICK)
    assert table.arm.beats == beats
    table.wait(TICK, driver)
    assert table.arm.beats == beats + 1
    assert table.hub.stopped is None


def test_message_that_waits_for_a_late_server_counts(table: Table) -> None:
    heartbeat = Received(lambda: table.t)
    driver = table.join(PAGES[0], heartbeat=heartbeat)
    table.touch(driver.person.key)
    table.arm.moves = True
    for _ in range(5):
        table.t += 2.0
        heartbeat.received = table.t - 0.1
        table.hub.tick()
    assert moves(table)
    # Messages that are handled late count from their receipt.
    table.t += 0.2
    table.hub.heartbeat(driver)
    table.hub.tick()
    assert not moves(table)


def test_reason_distinguishes_a_silent_window_from_a_closed_one(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.touch(driver.person.key)
    table.arm.moves = True
    table.hub.leave(driver)
    table.wait(2 * Settings.silence)
    assert table.hub.stopped is not None
    assert table.hub.stopped.why == "Window 1 lost the connection while the arm moved."


def test_stop_is_requested_until_a_newer_state_is_stopped(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.arm.taken = 0
    table.arm.moves = True
    table.touch(driver.person.key)
    table.stop("Vera")
    table.wait(0.2, driver)
    assert stage(table) == ("stopped", "requested")
    # A stopped state that is older than the request does not confirm it.
    table.arm.stopped = True
    table.wait(TICK, driver)
    assert stage(table) == ("stopped", "requested")
    table.arm.taken = table.arm.stops
    table.wait(TICK, driver)
    assert stage(table) == ("stopped", "confirmed")
    # Every further press requests a stop again.
    table.stop("Vera")
    assert stage(table) == ("stopped", "requested")
    assert table.arm.stops == 2


def stage(table: Table) -> tuple[str, str]:
    shown = status.common(table.hub)
    return shown["mood"], shown["stop"]


def test_arm_that_does_not_answer_is_reported_and_then_stopped(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.touch(driver.person.key)
    table.arm.moves = True
    assert status.health(table.hub) is None
    table.arm.taken, table.arm.age = 0, 0.4
    table.wait(TICK, driver)
    assert status.health(table.hub) == "No answer from the arm's process for 0.4 s."
    shown = status.common(table.hub)
    assert (shown["mood"], shown["headline"]) == ("lost", "No answer from the arm")
    assert shown["stopped"] is None
    table.arm.age = 0.6
    table.wait(TICK, driver)
    stopped = table.hub.stopped
    assert stopped is not None
    cause = StopCause("The arm's process did not answer for 0.6 s.", at=stopped.cause.at)
    assert stopped == StopRecord(cause, ticket=1, confirmed=False)
    assert stage(table) == ("stopped", "requested")


@pytest.fixture
def line() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Return both ends of a TCP connection."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        near = socket.create_connection(listening.getsockname())
        far, _ = listening.accept()
        with near, far:
            yield near, far


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="needs the kernel's times")
def test_open_connection_counts_as_long_as_the_other_host_answers() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        keep_alive(listening)
        with socket.create_connection(listening.getsockname()):
            far, _ = listening.accept()
            with far:
                arrival = Arrival(far)
                arrival.open = 1
                time.sleep(MAX_ACK_AGE + 1.0)
                # The probes of the kernel were answered.
                assert ack_age(far) < 2.0 < data_age(far)
                assert arrival.newest == pytest.approx(time.monotonic(), abs=0.1)
                arrival.open = 0
                assert time.monotonic() - arrival.newest > MAX_ACK_AGE


class LostLine:
    """A connection whose other host has answered nothing for ``seconds`` [s]."""

    def __init__(self, far: socket.socket, seconds: float) -> None:
        self._far, self._seconds = far, seconds

    def fileno(self) -> int:
        return self._far.fileno()

    def getsockopt(self, level: int, name: int, size: int, /) -> bytes:
        info = bytearray(self._far.getsockopt(level, name, size))
        struct.pack_into("=I", info, LAST_ACK_RECEIVED, round(1e3 * self._seconds))
        return bytes(info)


@pytest.mark.skipif(sys.platform != "linux", reason="needs the kernel's times")
@pytest.mark.parametrize(("seconds", "counts"), [(2.5, True), (3.5, False)])
def test_open_connection_to_a_lost_host_is_no_heartbeat(
    line: tuple[socket.socket, socket.socket], *, seconds: float, counts: bool
) -> None:
    arrival = Arrival(LostLine(line[1], seconds))
    time.sleep(0.15)
    arrival.open = 1
    assert (time.monotonic() - arrival.newest < 0.1) is counts


@pytest.mark.skipif(sys.platform != "linux", reason="needs the kernel's time of arrival")
def test_arrival_is_when_the_kernel_received_the_message(
    line: tuple[socket.socket, socket.socket],
) -> None:
    near, far = line
    arrival = Arrival(far)
    time.sleep(0.2)
    assert time.monotonic() - arrival.newest > 0.15
    before = time.monotonic()
    near.sendall(b"heartbeat\n")
    sent = time.monotonic()
    time.sleep(0.2)
    # The message waits unread and is handled late, but its arrival is when it was sent.
    margin = 0.1
    for handle in (lambda: None, lambda: far.recv(100), arrival.note):
        handle()
        assert before - margin < arrival.newest < sent + margin
    near.close()
    time.sleep(0.2)
    # The end of a connection is not a message.
    assert arrival.newest < sent + margin
