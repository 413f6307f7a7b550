"""Silence and lateness: what stops, pauses and frees the arm, and what counts as a heartbeat."""

from __future__ import annotations

import socket
import struct
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import PAUSE_TIMEOUT, SilenceProfile
from katana450.arm.control.state.state import Finding, Reason
from katana450.arm.control.state.stop_cause import StopCause
from katana450.arm.runtime.readiness import LAST_ACK_RECEIVED
from katana450.errors import LeaseError
from katana450.extensions.programs.serve_options import OWNER_SILENCE
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service import status
from katana450.server.service.command_gate import SETTLE_TIME, StopRecord
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import TICK
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant
from katana450.settings import Settings
from tests.gateway.test_hub import PAGES, Table, moves
from tests.gateway.test_program_runner import Staged

LATE = 0.2
"""Interval [s] of the checks of a delayed server, shorter than the heartbeat timeout."""


class Received(LastHeartbeat):
    """A connection whose newest message has a receipt time set by a test, and waits unhandled."""

    received = 0.0

    @property
    def newest(self) -> float:
        return self.received


def test_silent_driver_is_stopped_by_a_server_that_is_always_late(table: Table) -> None:
    table.driver()
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
    driver = table.driver()
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
    driver = table.driver()
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
    driver = table.driver()
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
    arrival = LastHeartbeat(line=LostLine(line[1], seconds))
    time.sleep(0.15)
    arrival.open = 1
    assert (time.monotonic() - arrival.newest < 0.1) is counts


@pytest.mark.skipif(sys.platform != "linux", reason="needs the kernel's time of arrival")
def test_arrival_is_when_the_kernel_received_the_message(
    line: tuple[socket.socket, socket.socket],
) -> None:
    near, far = line
    arrival = LastHeartbeat(line=far)
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


SERVER_LATE = Finding(Reason.SERVER_SILENT, 0.28)
PAUSED = Finding(Reason.PAUSED)


class LateServer(Staged):
    """A table whose program was paused because the server was late."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.owner = self.join(PAGES[0])
        self.plan(self.owner)
        self.programs.steer(self.owner, ProgramOrder.RUN)
        self.wait(0.1, self.owner)
        self.arm.rest = replace(self.arm.rest, paused=True, findings=(PAUSED, SERVER_LATE))

    @property
    def resumes(self) -> int:
        return sum(isinstance(command, cmd.Resume) for command in self.arm.commands)


@pytest.fixture
def late(session: Session) -> LateServer:
    return LateServer(session)


def test_program_resumes_after_what_waited_was_read(late: LateServer) -> None:
    late.wait(0.9 * SETTLE_TIME, late.owner)
    assert (late.resumes, late.status) == (0, "paused")
    late.wait(0.5 * SETTLE_TIME, late.owner)
    assert late.resumes > 0
    late.arm.rest = replace(late.arm.rest, paused=False, findings=())
    late.wait(0.1, late.owner)
    assert late.status == "running"


def test_pause_of_a_person_and_a_stop_last(late: LateServer) -> None:
    late.arm.rest = replace(late.arm.rest, findings=(PAUSED,))
    late.wait(3.0, late.owner)
    assert (late.resumes, late.status) == (0, "paused")
    late.arm.rest = replace(late.arm.rest, findings=(PAUSED, SERVER_LATE))
    late.stop("Somebody")
    late.wait(3.0, late.owner)
    assert (late.resumes, late.status) == (0, "stopped")


def test_lost_owner_ends_the_paused_program(late: LateServer) -> None:
    late.programs._owner._timeout = 0.5 * SETTLE_TIME
    late.wait(OWNER_SILENCE)
    progress = late.programs.progress()
    assert progress is not None
    assert (progress.status, "sends no heartbeats" in progress.why) == ("stopped", True)


JOG = cmd.Joints(np.zeros(5))


@pytest.fixture
def simulated(session: Session) -> Table:
    simulated = Table(session.begin(session.ready, 0.0, 0.0))
    simulated.arm.profile = SilenceProfile.SIMULATION
    return simulated


@pytest.fixture
def driver(simulated: Table) -> Participant:
    """Return a driver whose arm moves."""
    driver = simulated.join(PAGES[0])
    simulated.touch(driver.person.key)
    simulated.wait(1.0, driver)
    simulated.arm.moves = True
    return driver


def test_simulated_arm_pauses_and_the_next_command_moves_it(
    simulated: Table, driver: Participant
) -> None:
    drag = simulated.touch(driver.person.key)
    simulated.wait(Settings.silence - TICK)
    assert moves(simulated)
    simulated.wait(2 * TICK)
    assert not moves(simulated)
    assert (simulated.hub.stopped, simulated.arm.stops) == (None, 0)
    assert simulated.arm.cause is not None
    assert simulated.arm.cause.reason is Reason.DRIVER_SILENT
    # What waited on the line meanwhile is no new command.
    assert not simulated.hub.gate.is_current(drag)
    simulated.wait(1.0)
    simulated.wait(2 * TICK, driver)
    with pytest.raises(LeaseError, match="just paused"):
        simulated.hub.move(driver, JOG)
    simulated.wait(SETTLE_TIME, driver)
    simulated.hub.move(driver, JOG)
    assert simulated.arm.commands[-1] is JOG
    simulated.wait(2 * PAUSE_TIMEOUT, driver)
    assert simulated.arm.stops == 0


def test_paused_arm_does_not_move_for_a_driver_without_heartbeats(
    simulated: Table, driver: Participant
) -> None:
    simulated.wait(1.0)
    assert not moves(simulated)
    for _ in range(15):
        simulated.wait(0.1)
        # The control socket stalls, but gestures in the scene arrive.
        with pytest.raises(LeaseError, match="just paused"):
            simulated.touch(driver.person.key)
    simulated.wait(2 * TICK, driver)
    simulated.wait(SETTLE_TIME, driver)
    simulated.touch(driver.person.key)


def test_pause_becomes_a_stop_after_longer_silence(simulated: Table, driver: Participant) -> None:
    simulated.wait(PAUSE_TIMEOUT - 5 * TICK)
    assert simulated.arm.stops == 0
    simulated.wait(6 * TICK)
    assert simulated.hub.stopped is not None
    assert simulated.hub.stopped.why == f"{driver.person.name} was silent for 5 s."


@pytest.mark.usefixtures("driver")
def test_other_driver_ends_the_pause(simulated: Table) -> None:
    simulated.wait(1.0)
    other = simulated.join(PAGES[1])
    simulated.hub.take(other)
    simulated.wait(SETTLE_TIME + TICK, other)
    simulated.hub.move(other, JOG)
    simulated.wait(2 * PAUSE_TIMEOUT, other)
    assert simulated.hub.stopped is None


@pytest.mark.usefixtures("driver")
@pytest.mark.parametrize("profile", SilenceProfile)
def test_late_server_is_blamed_instead_of_the_line(
    simulated: Table, profile: SilenceProfile
) -> None:
    simulated.arm.profile = profile
    simulated.t += 0.2
    simulated.hub.tick()
    simulated.wait(0.1)
    assert not moves(simulated)
    if profile is SilenceProfile.SIMULATION:
        assert simulated.arm.cause is not None
        assert simulated.arm.cause.reason is Reason.MACHINE_BUSY
    else:
        assert simulated.hub.stopped is not None
        assert "This machine is too busy: its server was 0.18 s late." in simulated.hub.stopped.why
        assert "silent" not in simulated.hub.stopped.why


def test_pause_by_the_arm_voids_older_gestures(simulated: Table, driver: Participant) -> None:
    drag = simulated.touch(driver.person.key)
    simulated.arm.cause, simulated.arm.moves = Finding(Reason.LOOP_LATE, 0.3), False
    with pytest.raises(LeaseError, match="just paused"):
        simulated.hub.move(driver, JOG)
    assert not simulated.hub.gate.is_current(drag)
    simulated.wait(SETTLE_TIME + TICK, driver)
    simulated.arm.cause = None
    simulated.hub.move(driver, JOG)
    simulated.wait(1.0, driver)
    assert simulated.hub.stopped is None


@pytest.mark.parametrize("profile", SilenceProfile)
def test_closed_window_brakes_and_frees_the_arm(
    simulated: Table, driver: Participant, profile: SilenceProfile
) -> None:
    simulated.arm.profile = profile
    simulated.hub.close(Identity("session", None, Role.ADMIN), PAGES[0])
    assert not moves(simulated)
    if profile is SilenceProfile.REAL_ARM:
        assert simulated.hub.stopped is not None
        assert simulated.hub.stopped.why == "Window 1 closed the window while the arm moved."
        return
    assert simulated.arm.cause == Finding(Reason.DRIVER_LEFT)
    revocations = simulated.hub.gate.revocations
    other = simulated.join(PAGES[1], Role.OPERATOR)
    simulated.wait(SETTLE_TIME + TICK)
    simulated.hub.gate.acquire(other.actor)
    assert simulated.hub.lease.driver == other.person
    # What the page before had begun is void.
    assert simulated.hub.gate.revocations > revocations
    # Its page has lost the arm when it returns.
    with pytest.raises(LeaseError, match="Window 2 holds the arm"):
        simulated.touch(simulated.join(PAGES[0]).person.key)
    assert driver.person != other.person


def test_reloaded_page_keeps_the_arm_that_nobody_took(
    simulated: Table, driver: Participant
) -> None:
    simulated.arm.moves = False
    simulated.hub.close(Identity("session", None, Role.ADMIN), PAGES[0])
    simulated.hub.leave(driver)
    assert status.common(simulated.hub)["holder"] is None
    simulated.wait(1.0)
    again = simulated.join(PAGES[0])
    simulated.wait(TICK, again)
    assert simulated.hub.lease.driver == driver.person
    # A window that is unknown or does not drive changes nothing.
    simulated.hub.close(Identity("session", None, Role.ADMIN), PAGES[1])
    assert simulated.hub.lease.driver == driver.person
    assert simulated.hub.stopped is None
