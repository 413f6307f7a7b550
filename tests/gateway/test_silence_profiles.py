"""Test the reaction to silence: a simulated arm pauses, a real one stops until it is cleared."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.lease import Role
from katana450.arm.control.session import Session
from katana450.arm.control.silence import PAUSE_TIMEOUT, SilenceProfile
from katana450.arm.control.state import Finding, Reason
from katana450.errors import LeaseError
from katana450.server.service import status
from katana450.server.service.command_gate import SETTLE_TIME
from katana450.server.service.hub import TICK
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant
from katana450.settings import Settings
from tests.gateway.test_hub import PAGES, Table, moves

JOG = cmd.SetJoints(np.zeros(5))


@pytest.fixture
def table(session: Session) -> Table:
    table = Table(session.begin(session.ready, 0.0, 0.0))
    table.arm.profile = SilenceProfile.SIMULATION
    return table


@pytest.fixture
def driver(table: Table) -> Participant:
    """Return a driver whose arm moves."""
    driver = table.join(PAGES[0])
    table.touch(driver.person.key)
    table.wait(1.0, driver)
    table.arm.moves = True
    return driver


def test_simulated_arm_pauses_and_the_next_command_moves_it(
    table: Table, driver: Participant
) -> None:
    drag = table.touch(driver.person.key)
    table.wait(Settings.silence - TICK)
    assert moves(table)
    table.wait(2 * TICK)
    assert not moves(table)
    assert (table.hub.stopped, table.arm.stops) == (None, 0)
    assert table.arm.cause is not None
    assert table.arm.cause.reason is Reason.DRIVER_SILENT
    # What waited on the line meanwhile is no new command.
    assert not table.hub.gate.is_current(drag)
    table.wait(1.0)
    table.wait(2 * TICK, driver)
    with pytest.raises(LeaseError, match="just paused"):
        table.hub.move(driver, JOG)
    table.wait(SETTLE_TIME, driver)
    table.hub.move(driver, JOG)
    assert table.arm.commands[-1] is JOG
    table.wait(2 * PAUSE_TIMEOUT, driver)
    assert table.arm.stops == 0


def test_paused_arm_does_not_move_for_a_driver_without_heartbeats(
    table: Table, driver: Participant
) -> None:
    table.wait(1.0)
    assert not moves(table)
    for _ in range(15):
        table.wait(0.1)
        # The control socket stalls, but gestures in the scene arrive.
        with pytest.raises(LeaseError, match="just paused"):
            table.touch(driver.person.key)
    table.wait(2 * TICK, driver)
    table.wait(SETTLE_TIME, driver)
    table.touch(driver.person.key)


def test_pause_becomes_a_stop_after_longer_silence(table: Table, driver: Participant) -> None:
    table.wait(PAUSE_TIMEOUT - 5 * TICK)
    assert table.arm.stops == 0
    table.wait(6 * TICK)
    assert table.hub.stopped is not None
    assert table.hub.stopped.why == f"{driver.person.name} was silent for 5 s."


@pytest.mark.usefixtures("driver")
def test_other_driver_ends_the_pause(table: Table) -> None:
    table.wait(1.0)
    other = table.join(PAGES[1])
    table.hub.take(other)
    table.wait(SETTLE_TIME + TICK, other)
    table.hub.move(other, JOG)
    table.wait(2 * PAUSE_TIMEOUT, other)
    assert table.hub.stopped is None


@pytest.mark.usefixtures("driver")
@pytest.mark.parametrize("profile", SilenceProfile)
def test_late_server_is_blamed_instead_of_the_line(table: Table, profile: SilenceProfile) -> None:
    table.arm.profile = profile
    table.t += 0.2
    table.hub.tick()
    table.wait(0.1)
    assert not moves(table)
    if profile is SilenceProfile.SIMULATION:
        assert table.arm.cause is not None
        assert table.arm.cause.reason is Reason.MACHINE_BUSY
    else:
        assert table.hub.stopped is not None
        assert "This machine is too busy: its server was 0.18 s late." in table.hub.stopped.why
        assert "silent" not in table.hub.stopped.why


def test_pause_by_the_arm_voids_older_gestures(table: Table, driver: Participant) -> None:
    drag = table.touch(driver.person.key)
    table.arm.cause, table.arm.moves = Finding(Reason.LOOP_LATE, 0.3), False
    with pytest.raises(LeaseError, match="just paused"):
        table.hub.move(driver, JOG)
    assert not table.hub.gate.is_current(drag)
    table.wait(SETTLE_TIME + TICK, driver)
    table.arm.cause = None
    table.hub.move(driver, JOG)
    table.wait(1.0, driver)
    assert table.hub.stopped is None


@pytest.mark.parametrize("profile", SilenceProfile)
def test_closed_window_brakes_and_frees_the_arm(
    table: Table, driver: Participant, profile: SilenceProfile
) -> None:
    table.arm.profile = profile
    table.hub.close(Identity("session", None, Role.ADMIN), PAGES[0])
    assert not moves(table)
    if profile is SilenceProfile.REAL_ARM:
        assert table.hub.stopped is not None
        assert table.hub.stopped.why == "Window 1 closed the window while the arm moved."
        return
    assert table.arm.cause == Finding(Reason.DRIVER_LEFT)
    revocations = table.hub.gate.revocations
    other = table.join(PAGES[1], Role.OPERATOR)
    table.wait(SETTLE_TIME + TICK)
    table.hub.acquire(other)
    assert table.hub.lease.driver == other.person
    # What the page before had begun is void.
    assert table.hub.gate.revocations > revocations
    # Its page has lost the arm when it returns.
    with pytest.raises(LeaseError, match="Window 2 holds the arm"):
        table.touch(table.join(PAGES[0]).person.key)
    assert driver.person != other.person


def test_reloaded_page_keeps_the_arm_that_nobody_took(table: Table, driver: Participant) -> None:
    table.arm.moves = False
    table.hub.close(Identity("session", None, Role.ADMIN), PAGES[0])
    table.hub.leave(driver)
    assert status.common(table.hub)["holder"] is None
    table.wait(1.0)
    again = table.join(PAGES[0])
    table.wait(TICK, again)
    assert table.hub.lease.driver == driver.person
    # A window that is unknown or does not drive changes nothing.
    table.hub.close(Identity("session", None, Role.ADMIN), PAGES[1])
    assert table.hub.lease.driver == driver.person
    assert table.hub.stopped is None
