"""Test the hub with a simulated clock: lease, stops and silence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast
from unittest.mock import Mock

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import LEASE_TIMEOUT, Actor, CommandChannel, Lease, Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state.state import ActiveStop, Finding, Reason, State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.state_publisher import Snapshot
from katana450.errors import LeaseError
from katana450.maths.collision.engine import Contact
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api import answers, requests
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budgets
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant, actor_of, key_of
from katana450.server.service.runner import Runner
from katana450.settings import Settings

PAGES = ("first-page-of-all", "second-page-of-all")


class FakeArm:
    """An arm that records its commands, and moves when a test sets ``moving``."""

    # Some tests set these.
    robot: Robot
    arm: MountedArm
    loop_timing: Any
    session: Session
    planning_failure = ""
    nearest: Contact | None = None

    def __init__(self, state: State) -> None:
        self.rest = state
        self.profile = SilenceProfile.REAL_ARM
        self.cause: Finding | None = None
        self.moves = False
        self.holds = 0
        self.stops = 0
        self.beats = 0
        self.stopped = False
        self.age = 0.0
        self.clear_refusal = ""
        self.taken: int | None = None
        self.jogs: list[tuple[tuple[float, ...], JogFrame]] = []
        self.fraction = 1.0
        self.commands: list[cmd.Command] = []
        self.actors: list[Actor] = []

    @property
    def state(self) -> State:
        stopped = ActiveStop(0.0, 0.0) if self.stopped else self.rest.stopped
        findings = self.rest.findings
        if self.cause is not None:
            findings = (Finding(Reason.WAITING), self.cause)
        state = replace(self.rest, stopped=stopped, findings=findings)
        return replace(state, goal=state.setpoint + 0.1) if self.moves else state

    @property
    def snapshot(self) -> Snapshot:
        """A snapshot with every stop, unless a test sets their number."""
        return Snapshot(self.state, self.stops if self.taken is None else self.taken)

    @property
    def caught_up(self) -> bool:
        return self.taken is None or self.taken == self.stops

    @property
    def busy(self) -> bool:
        return False

    def heartbeat(self) -> None:
        self.beats += 1

    def choices(self) -> tuple[BranchOption, ...]:
        return ()

    def deliver(self, command: cmd.Command, actor: Actor) -> int:
        self.actors.append(actor)
        match command:
            case cmd.Stop():
                self.stops += 1
                if self.taken is None:
                    self.stopped = True
                    self.moves = False
                return self.stops
            case cmd.ClearStop():
                self.stopped = False
            case cmd.Hold(finding=cause):
                self.holds += 1
                self.moves = False
                self.cause = cause
            case cmd.Jog(rates=rates, frame=frame):
                self.jogs.append((tuple(rates.tolist()), frame))
            case _:
                if isinstance(command, cmd.Speed):
                    self.fraction = command.value
                if actor.channel is not CommandChannel.SERVER:
                    self.commands.append(command)
        return len(self.commands)


class Table:
    """A hub with its arm and a clock that tests set."""

    def __init__(self, state: State, runner: Callable[[Hub], Runner] | None = None) -> None:
        self.t = 100.0
        self.hub = Hub(lambda: self.t)
        if runner is not None:
            self.hub.use_runner(runner(self.hub))
        self.arm = FakeArm(state)
        self.hub.gate.arm = cast(Any, self.arm)
        self.notices_of: dict[str, list[dict[str, Any]]] = {}

    def join(
        self,
        page: str,
        role: Role = Role.ADMIN,
        name: str | None = None,
        heartbeat: LastHeartbeat | None = None,
    ) -> Participant:
        notices = self.notices_of.setdefault(page, [])
        return self.hub.join(Identity("session", name, role), page, notices.append, heartbeat)

    def driver(self) -> Participant:
        """Return the window of the first page, which has touched a control of the scene."""
        participant = self.join(PAGES[0])
        self.touch(participant.person.key)
        return participant

    def touch(self, key: str) -> Actor:
        """Touch a control of the scene in the window of ``key``."""
        gate = self.hub.gate
        return gate.claim(self.hub.at_scene(key, gate.revocations))

    def stop(self, name: str, press: str | None = None) -> None:
        """Press STOP as a participant of ``name``."""
        self.hub.stop(actor_of(Identity("anybody", name, Role.VIEWER), CommandChannel.PAGE), press)

    def wait(self, seconds: float, *alive: Participant) -> None:
        """Advance the clock, with heartbeats of the windows ``alive``."""
        end = self.t + seconds
        while self.t < end - 1e-9:
            self.t += min(TICK, end - self.t)
            for participant in alive:
                self.hub.heartbeat(participant)
            self.hub.tick()


def stands_still(table: Table) -> bool:
    return table.arm.stopped


def moves(table: Table) -> bool:
    return table.arm.moves


def test_first_window_to_use_a_control_gets_the_lease(table: Table) -> None:
    first, second = (table.join(page) for page in PAGES)
    assert [first.person.name, second.person.name] == ["Window 1", "Window 2"]
    table.touch(second.person.key)
    assert table.hub.lease.holder == second.person
    with pytest.raises(LeaseError, match="Window 2 holds the arm"):
        table.touch(first.person.key)
    assert table.arm.holds == 0


def test_window_without_control_socket_cannot_drive(table: Table) -> None:
    participant = table.driver()
    table.hub.leave(participant)
    with pytest.raises(LeaseError, match="start page"):
        table.touch(participant.person.key)


def test_stopped_arm_moves_only_after_clear_stop(table: Table) -> None:
    driver, other = (table.join(page) for page in PAGES)
    drag = table.touch(driver.person.key)
    table.arm.moves = True
    table.stop("Window 2")
    assert not table.hub.gate.is_current(drag)
    assert not moves(table)
    jog = cmd.Jog(np.array((0.1, 0.0, 0.0, 0.0, 0.0)), JogFrame.BASE)
    for act in (lambda: table.touch(driver.person.key), lambda: table.hub.move(driver, jog)):
        with pytest.raises(LeaseError, match="stopped"):
            act()
    # Only the driver may clear the stop.
    with pytest.raises(LeaseError, match="Window 1 holds"):
        table.hub.move(other, cmd.ClearStop())
    assert stands_still(table)
    table.hub.move(driver, cmd.ClearStop())
    assert not stands_still(table)
    assert not moves(table)
    table.touch(driver.person.key)


def test_repeated_stop_press_counts_once(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.stop("Window 1", "a press")
    table.stop("Window 1", "a press")
    table.hub.move(driver, cmd.ClearStop())
    table.stop("Window 1", "a press")
    assert not stands_still(table)
    table.stop("Window 1", "another")
    assert stands_still(table)
    table.hub.move(driver, cmd.ClearStop())
    # Presses without a name all count.
    for _ in range(2):
        table.stop("Window 1")
        assert stands_still(table)
        table.hub.move(driver, cmd.ClearStop())


def test_listeners_are_called_when_a_stop_begins_and_ends(table: Table) -> None:
    driver, shown = table.join(PAGES[0]), []
    table.hub.stop_news.listeners.add(lambda: shown.append(table.hub.stopped is not None))
    # A flood of STOP causes no flood of messages.
    for press in range(5):
        table.stop("Window 1", f"press {press}")
        table.wait(TICK, driver)
    assert shown in ([True], [True, True])
    table.hub.move(driver, cmd.ClearStop())
    table.wait(TICK, driver)
    assert shown.pop() is False


def test_arm_that_lost_its_stop_is_stopped_again(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.stop("Window 1")
    table.arm.stopped, table.arm.moves = False, True
    table.wait(TICK, driver)
    assert table.arm.stopped
    assert not moves(table)


class FakePicture:
    def age(self, t: float) -> float:
        return t - 100.0


def test_silent_driver_of_a_moving_arm_causes_a_stop(table: Table) -> None:
    driver = table.driver()
    table.wait(1.0, driver)
    table.arm.moves = True
    table.wait(Settings.silence - TICK)
    assert moves(table)
    table.wait(2 * TICK)
    assert not moves(table)
    assert table.hub.stopped is not None
    assert table.hub.stopped.why == "Window 1 fell silent while the arm moved."
    # A late message starts no motion.
    table.hub.heartbeat(driver)
    with pytest.raises(LeaseError, match="clear the stop"):
        table.touch(driver.person.key)


def test_silent_driver_at_rest_loses_the_lease_without_a_stop(table: Table) -> None:
    driver = table.driver()
    table.wait(LEASE_TIMEOUT - 2 * TICK)
    assert table.hub.lease.holder == driver.person
    table.wait(3 * TICK)
    assert (table.hub.lease, table.hub.stopped) == (Lease(), None)


@pytest.mark.parametrize(
    "change",
    [
        lambda hub, driver, other: hub.hand_over(driver, other.number),
        lambda hub, _, other: hub.take(other),
        lambda hub, driver, _: hub.release_lease(driver),
    ],
    ids=["handed over", "taken", "given up"],
)
def test_new_driver_gets_an_arm_without_targets(
    table: Table, change: Callable[[Hub, Participant, Participant], None]
) -> None:
    driver, other = (table.join(page) for page in PAGES)
    drag = table.touch(driver.person.key)
    table.arm.moves = True
    change(table.hub, driver, other)
    assert not moves(table)
    assert not table.hub.gate.is_current(drag)


def test_reloaded_page_keeps_its_identity(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.join(PAGES[1])
    table.touch(driver.person.key)
    table.hub.leave(driver)
    again = table.join(PAGES[0])
    assert again.person == driver.person
    table.touch(again.person.key)
    # The old socket ends after the new one has begun.
    fresh = table.join(PAGES[0])
    table.hub.leave(again)
    assert table.hub.participant(fresh.person.key) is fresh


def test_two_browsers_with_one_link_are_two_people(table: Table) -> None:
    anna, second = (table.join(page, Role.OPERATOR, "Anna") for page in PAGES)
    assert anna.person.name == "Anna"
    assert second.person.name == "Anna (2)"
    assert anna.person != second.person


def test_page_name_of_another_session_is_another_window(table: Table) -> None:
    table.driver()
    stranger = Identity("another session", None, Role.ADMIN)
    with pytest.raises(LeaseError):
        table.touch(key_of(stranger, PAGES[0]))


def test_released_jog_is_ended_explicitly(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.move(driver, cmd.Jog(np.array((0.2, 0.0, 0.0, 0.0, 0.0)), JogFrame.BASE))
    table.hub.move(driver, cmd.Jog(np.array((0.0,) * 5), JogFrame.BASE))
    assert table.arm.jogs[-1] == ((0.0,) * 5, JogFrame.BASE)
    # After the end of the jog a silent driver causes no stop.
    table.wait(2 * Settings.silence)
    assert table.arm.stops == 0


def test_age_is_that_of_the_windows_own_picture(table: Table) -> None:
    first, second = (table.join(page) for page in PAGES)
    picture = FakePicture()
    table.hub.pictures.show(first.person.key, picture)
    table.t += 1.5
    assert table.hub.pictures.age(first.person.key, table.hub.clock()) == pytest.approx(1.5)
    assert table.hub.pictures.age(second.person.key, table.hub.clock()) == 0.0
    table.hub.pictures.hide(picture)
    assert table.hub.pictures.age(first.person.key, table.hub.clock()) == 0.0


def test_no_lease_before_the_arm_is_ready() -> None:
    hub = Hub(lambda: 0.0)
    participant = hub.join(Identity("session", None, Role.ADMIN), PAGES[0], lambda _: None)
    with pytest.raises(LeaseError, match="not ready yet"):
        hub.gate.claim(participant.actor)
    hub.tick()
    hub.stop(participant.actor)
    hub.move(participant, cmd.ClearStop())


def _snapshot() -> Snapshot:
    return Snapshot(cast(State, Mock()), 0)


def test_branches_are_computed_once_per_snapshot() -> None:
    hub, arm, computed = Hub(lambda: 0.0), Mock(snapshot=_snapshot()), []

    def choices() -> tuple[BranchOption, ...]:
        computed.append(1)
        return ()

    arm.choices = choices
    hub.gate.arm = cast(ArmHandle, arm)
    budgets = Budgets(hub.clock)
    for number in range(3):
        identity = Identity(f"session-{number}", "Viewer", Role.VIEWER)
        window = hub.join(identity, "a-page", lambda _notice: None)
        request = requests.Query(at="branches", id=number)
        answer = Dispatcher(hub).handle(window, request, budgets.of(identity.session))
        assert answer == answers.Branches(choices=[], id=number)
    assert len(computed) == 1
    arm.snapshot = _snapshot()
    Dispatcher(hub).query("branches")
    assert len(computed) == 2
