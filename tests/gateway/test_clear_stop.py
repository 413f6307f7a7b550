"""Test who may clear a stop and when, and how the gate adopts a stop of another path."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import SERVER, Actor, CommandChannel, Grounds, Person, Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import ActiveStop, State
from katana450.arm.control.state.stop_cause import StopCause, pressed
from katana450.arm.runtime.pipes.state_publisher import Snapshot
from katana450.errors import LeaseError
from katana450.server.service import status
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant, key_of, presser_of
from katana450.server.service.recorder import Note
from tests.gateway.test_hub import PAGES, FakeArm, Table

EARLY = "The arm was stopped just now. Clear the stop in 0.6 s."


class StoppableArm(FakeArm):
    """An arm that another path can stop."""

    def __init__(self, state: State) -> None:
        super().__init__(state)
        self.stop_cause: StopCause | None = None
        self.presses: tuple[str, ...] = ()
        self.sent: list[cmd.Stop] = []
        self.newest = 0.0
        self.known = math.nan

    @property
    def state(self) -> State:
        state = replace(super().state, presses=self.presses)
        if self.stop_cause is None:
            return state
        return replace(state, stopped=ActiveStop(0.0, 0.0, self.stop_cause, self.newest))

    @property
    def snapshot(self) -> Snapshot:
        return Snapshot(self.state, self.stops)

    def stop_elsewhere(self, cause: StopCause) -> None:
        """Stop as after a press on the port of STOP."""
        self.stop_cause, self.presses = cause, (*self.presses, cause.press)

    def deliver(self, command: cmd.Command, actor: Actor) -> int:
        if isinstance(command, cmd.ClearStop):
            self.stop_cause, self.known = None, command.known
        if isinstance(command, cmd.Stop):
            self.sent.append(command)
        return super().deliver(command, actor)


class ClearingTable(Table):
    """A table with such an arm, and people with links."""

    def __init__(self, state: State) -> None:
        super().__init__(state)
        self.hub = Hub(lambda: self.t)
        self.stoppable = StoppableArm(state)
        self.arm = self.stoppable
        self.hub.gate.arm = cast(Any, self.arm)

    def person(self, name: str, role: Role) -> Participant:
        return self.hub.join(Identity(name, name, role), PAGES[0], lambda _notice: None)


@pytest.fixture
def table(session: Session) -> ClearingTable:
    return ClearingTable(session.begin(session.ready, 0.0, 0.0))


def test_stop_on_another_path_is_adopted_with_its_cause(table: ClearingTable) -> None:
    driver, other = (table.join(page) for page in PAGES)
    gesture = table.touch(driver.person.key)
    key = key_of(Identity("session", None, Role.ADMIN), PAGES[1])
    table.stoppable.stop_elsewhere(pressed("Somebody", key, "one", 5.0))
    revocations = table.hub.gate.revocations
    table.wait(TICK, driver)
    stopped = table.hub.stopped
    assert stopped is not None
    # The page is named as on the main port.
    assert stopped.why == f"{other.person.name} pressed STOP."
    assert stopped.stage == "confirmed"
    assert table.hub.gate.revocations == revocations + 1
    assert not table.hub.gate.is_current(gesture)
    # The Stop that ends plans has the same press and names its page, and a copy by the main path
    # changes nothing.
    assert table.stoppable.sent == [cmd.Stop(pressed(other.person.name, key, "one", 5.0))]
    assert table.hub.stop(other.actor, "one") == 0
    table.hub.move(driver, cmd.ClearStop())
    table.wait(TICK, driver)
    assert table.hub.stop(other.actor, "one") == 0
    assert (table.hub.stopped, table.arm.stops) == (None, 1)


def test_copy_of_the_press_of_an_unknown_page_names_it(table: ClearingTable) -> None:
    # The server has started again, and the page has not returned.
    key = "session/page"
    table.stoppable.stop_elsewhere(pressed("Somebody", key, "one", 5.0))
    table.wait(TICK)
    for whose, why in (("session/more", "Somebody"), (key, "Window 9"), (key, "Window 9")):
        actor = Actor(Person(whose, "Window 9", Role.ADMIN), CommandChannel.PAGE)
        stopped, sent = table.hub.stopped, len(table.stoppable.sent)
        assert stopped is not None
        assert table.hub.stop(actor, "one") == 0
        assert table.hub.stopped is not None
        assert table.hub.stopped.why == f"{why} pressed STOP."
        names = [note.cause.by for note in table.stoppable.sent[sent:]]
        assert names == ([] if stopped.why == table.hub.stopped.why else ["Window 9"])
        assert table.hub.stopped.cause.at == 5.0


def stops(table: ClearingTable) -> list[Note]:
    """Return the stops that were noted for the event log."""
    recorder = table.hub.recorder
    notes = [recorder.notes.get_nowait() for _ in range(recorder.notes.qsize())]
    return [note for note in notes if note is not None and note.kind == "stop"]


@pytest.mark.parametrize("copy_first", [False, True])
@pytest.mark.parametrize("own_stop", [False, True])
def test_press_on_another_path_is_noted_once_with_its_presser(
    table: ClearingTable, copy_first: bool, own_stop: bool
) -> None:
    other = table.person("Vera", Role.VIEWER)
    table.hub.recorder.enabled = True
    table.stoppable.stop_elsewhere(pressed("Vera", other.person.key, "one", 5.0))
    if own_stop:
        table.hub.gate.protect("Window 1 fell silent while the arm moved.")
    if copy_first:
        table.hub.stop(other.actor, "one")
    table.wait(TICK)
    table.hub.stop(other.actor, "one")
    table.wait(TICK)
    *protections, press = stops(table)
    assert [note.actor for note in protections] == (
        [replace(SERVER, grounds=Grounds.SERVER)] if own_stop else []
    )
    assert press.actor == replace(other.actor, grounds=Grounds.SAFETY)
    if own_stop:
        assert press.what == {"stop": "pressed", "repeated": True}
    else:
        assert (press.what, press.why) == ({"stop": "pressed"}, "Vera pressed STOP.")
        assert press.always


def test_presser_without_a_window_has_the_role_and_the_number_of_its_link() -> None:
    vera = Person("7/page", "Vera", Role.OPERATOR, "7", "10.0.0.7")
    cause = pressed("Vera, curl", "7", "one", 5.0)
    known, unknown = (presser_of(cause, people, links=True) for people in ([vera], []))
    assert known == Actor(
        Person("7", "Vera, curl", Role.OPERATOR), CommandChannel.HTTP, grounds=Grounds.SAFETY
    )
    assert known.person.link == "7"
    assert unknown is not None
    assert unknown.person.role is Role.VIEWER
    # Without links everybody is an admin.
    anybody = presser_of(cause, [], links=False)
    assert anybody is not None
    assert (anybody.person.role, anybody.person.link) == (Role.ADMIN, "")
    assert presser_of(StopCause(), [vera], links=True) is None


def test_clear_stop_names_the_newest_stop_that_the_gate_knows(table: ClearingTable) -> None:
    driver = table.join(PAGES[0])
    table.hub.move(driver, cmd.ClearStop())
    assert table.stoppable.known == -math.inf
    table.stoppable.newest = 7.0
    table.stoppable.stop_elsewhere(pressed("Vera", "v", "one", 5.0))
    table.wait(TICK, driver)
    table.hub.move(driver, cmd.ClearStop())
    assert table.stoppable.known == 7.0


def test_stop_by_the_arm_itself_keeps_its_reason(table: ClearingTable) -> None:
    table.stoppable.stop_elsewhere(StopCause("The arm ran away."))
    table.wait(TICK)
    assert table.hub.stopped is not None
    assert table.hub.stopped.why == "The arm ran away."


def test_first_stop_that_reached_the_arm_is_named(table: ClearingTable) -> None:
    driver = table.join(PAGES[0])
    # The server stops the arm too, before it knows of the press.
    table.stoppable.stop_elsewhere(pressed("Vera", "v", "one", 5.0))
    table.hub.gate.protect("Window 1 fell silent while the arm moved.")
    table.wait(TICK, driver)
    assert table.hub.stopped is not None
    assert table.hub.stopped.why == "Vera pressed STOP."


def test_clear_stop_is_offered_with_the_reason_to_wait(table: ClearingTable) -> None:
    driver, other = (table.join(page) for page in PAGES)
    table.touch(driver.person.key)
    table.hub.stop(other.actor)
    table.arm.clear_refusal = EARLY
    shown = status.common(table.hub) | status.of(table.hub, driver)
    assert (shown["may_clear_stop"], shown["wait"]) == (True, EARLY)
    assert not status.of(table.hub, other)["may_clear_stop"]
    # A viewer may not, even while nobody drives.
    viewer = table.person("Vera", Role.VIEWER)
    table.hub.release_lease(driver)
    assert status.of(table.hub, driver)["may_clear_stop"]
    assert not status.of(table.hub, viewer)["may_clear_stop"]
    table.hub.gate.acquire(driver.actor)
    with pytest.raises(LeaseError, match=r"Clear the stop in 0\.6 s"):
        table.hub.move(driver, cmd.ClearStop())
    assert table.hub.stopped is not None
    # A person who may not clear it learns that, and gets no lease.
    with pytest.raises(LeaseError, match="holds the arm"):
        table.hub.move(other, cmd.ClearStop())
    until = f"{driver.person.name} can clear the stop."
    assert status.of(table.hub, other)["until"] == until
    table.arm.clear_refusal = ""
    assert status.common(table.hub)["wait"] == ""
    table.hub.move(driver, cmd.ClearStop())
    assert table.hub.stopped is None


def test_refused_clear_stop_acquires_no_lease(table: ClearingTable) -> None:
    driver = table.join(PAGES[0])
    table.hub.stop(driver.actor)
    table.arm.clear_refusal = EARLY
    with pytest.raises(LeaseError, match="just now"):
        table.hub.move(driver, cmd.ClearStop())
    assert table.hub.lease.holder is None


def test_stop_during_the_start_is_confirmed_if_the_arm_was_stopped_on_another_path(
    table: ClearingTable,
) -> None:
    driver = table.join(PAGES[0])
    # The page is there before the arm. Its STOP goes to the gate and to the port of STOP.
    table.hub.gate.arm = None
    table.hub.stop(driver.actor, "one")
    assert table.arm.stops == 0
    table.stoppable.stop_elsewhere(pressed("Somebody", driver.person.key, "one", 5.0))
    table.hub.gate.arm = cast(Any, table.arm)
    table.wait(2 * TICK, driver)
    stopped = table.hub.stopped
    assert stopped is not None
    assert stopped.stage == "confirmed"
    table.hub.move(driver, cmd.ClearStop())
    table.wait(TICK, driver)
    assert table.hub.stopped is None


def test_full_disk_is_reported(table: ClearingTable) -> None:
    table.hub.recorder.problem = "The event log is not written: No space left on device."
    assert status.health(table.hub) == table.hub.recorder.problem
    assert status.common(table.hub)["problem"] == table.hub.recorder.problem
    table.hub.recorder.problem = ""
    table.hub.shown = {"episodes": {"problem": "Nothing is recorded now: No space left on device."}}
    assert status.health(table.hub) == "Nothing is recorded now: No space left on device."
    table.hub.shown = {"episodes": {"problem": ""}}
    assert status.health(table.hub) is None


def test_missing_path_of_stop_is_reported(table: ClearingTable) -> None:
    assert status.health(table.hub) is None
    table.hub.stop_path.problem = "STOP is not served on port 8081 now."
    assert status.health(table.hub) == "STOP is not served on port 8081 now."
    assert status.common(table.hub)["problem"] == "STOP is not served on port 8081 now."
