"""Who may move the arm, told by a clock of the test's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.choices import Choice
from katana450.arm.control.event_log import Entry
from katana450.arm.control.lease import LOST_AFTER, Lease, Role
from katana450.arm.control.margins import Margins
from katana450.arm.control.pouring import Pouring
from katana450.arm.control.session import Session
from katana450.arm.control.state import Finding, Halt, Reason, State
from katana450.arm.control.things import Environment
from katana450.arm.robot.machine import Machine
from katana450.arm.robot.model import RobotModel
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.state_publisher import Snapshot
from katana450.errors import LeaseError
from katana450.extensions.programs.bench import PlanContext
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api.fields import Rates
from katana450.server.service import serialize
from katana450.server.service.heartbeats import Heartbeat
from katana450.server.service.hub import TICK, Hub, Window, key_of
from katana450.server.service.vrml_nodes import Nodes
from katana450.server.web.authenticator import Identity
from katana450.settings import Settings

PAGES = ("first-page-of-all", "second-page-of-all")


class FakeArm:
    """Remembers what it was told; moves when the test says so."""

    # What a hub does not ask for.
    model: RobotModel | Machine
    robot: RobotModel
    nodes: Nodes
    ready: FloatArray
    lateness: LoopTiming
    surroundings: Environment
    pouring: Pouring | None
    rig: PlanContext
    margins: Margins
    holding: FloatArray | None

    def __init__(self, state: State) -> None:
        self.rest = state
        self.moves = False
        self.holds = 0
        self.stops = 0
        self.beats = 0
        self.halted = False
        self.age = 0.0
        self.taken: int | None = None
        self.jogs: list[tuple[Rates, JogFrame]] = []
        self.share = 1.0
        self.commands: list[cmd.Command] = []
        self.ledger: tuple[Entry, ...] = ()

    @property
    def state(self) -> State:
        halted = Halt(0.0, 0.0) if self.halted else None
        if not self.moves:
            return replace(self.rest, stopped=halted)
        return replace(self.rest, goal=self.rest.setpoint + 0.1, stopped=halted)

    @property
    def snapshot(self) -> Snapshot:
        """With every stop in it, unless the test says how many."""
        return Snapshot(self.state, self.stops if self.taken is None else self.taken)

    @property
    def caught_up(self) -> bool:
        return self.taken is None or self.taken == self.stops

    @property
    def busy(self) -> bool:
        return False

    def beat(self) -> None:
        self.beats += 1

    def stop(self) -> int:
        self.stops += 1
        if self.taken is None:
            self.halted = True
            self.moves = False
        return self.stops

    def release(self) -> None:
        self.halted = False

    def hold(self) -> None:
        self.holds += 1
        self.moves = False

    def jog(self, rates: Rates, frame: JogFrame) -> None:
        self.jogs.append((rates, frame))

    def limit(self, share: float) -> None:
        self.share = share

    def choices(self) -> tuple[Choice, ...]:
        return ()

    def put(self, command: cmd.Command) -> int:
        self.commands.append(command)
        return len(self.commands)


class Table:
    """A hub, its arm, and the hands of a clock."""

    def __init__(self, state: State) -> None:
        self.t = 100.0
        self.hub = Hub(lambda: self.t)
        self.arm = self.hub.arm = FakeArm(state)
        self.told: dict[str, list[dict[str, Any]]] = {}

    def join(
        self,
        page: str,
        role: Role = Role.ADMIN,
        name: str | None = None,
        heartbeat: Heartbeat | None = None,
    ) -> Window:
        told = self.told.setdefault(page, [])
        return self.hub.join(Identity("session", name, role), page, told.append, heartbeat)

    def wait(self, seconds: float, *alive: Window) -> None:
        """Let time pass, with signs of life of those who are ``alive``."""
        end = self.t + seconds
        while self.t < end - 1e-9:
            self.t += min(TICK, end - self.t)
            for window in alive:
                self.hub.beat(window)
            self.hub.tick()


def stands_still(table: Table) -> bool:
    return table.arm.halted


def moves(table: Table) -> bool:
    return table.arm.moves


@pytest.fixture
def table(session: Session) -> Table:
    return Table(session.begin(session.ready, 0.0, 0.0))


def test_who_touches_a_control_first_has_the_arm(table: Table) -> None:
    first, second = (table.join(page) for page in PAGES)
    assert [first.person.name, second.person.name] == ["Window 1", "Window 2"]
    table.hub.drive(second.person.key)
    assert table.hub.lease.holder == second.person
    with pytest.raises(LeaseError, match="Window 2 holds the arm"):
        table.hub.drive(first.person.key)
    assert table.arm.holds == 0


def test_the_journal_has_who_drove_and_who_stopped(table: Table) -> None:
    driver, watcher = table.join(PAGES[0]), table.join(PAGES[1], Role.VIEWER, "Vera")
    entries = [
        Entry(table.t, Finding(Reason.AXIS_LIMIT, 0.5, axis=1), began=True),
        Entry(table.t, Finding(Reason.CONTACT, 0.006, parts=("finger_left_link", "table")), True),
        Entry(table.t, Finding(Reason.HALTED, 0.02, time=0.3), began=True),
    ]
    table.arm.ledger = tuple(entries[:1])
    table.wait(TICK)
    table.hub.drive(driver.person.key)
    table.arm.ledger = tuple(entries[:2])
    table.wait(TICK)
    table.hub.stop(watcher.person.name)
    table.arm.ledger = tuple(entries[1:])
    table.wait(2 * TICK)
    lines = [serialize.line(line) for line in table.hub.journal.lines]
    assert [line.who for line in lines] == [None, driver.person.name, "Vera"]
    told = [line.finding for line in lines]
    assert [each.reason for each in told] == ["axis limit", "contact", "halted"]
    assert [(each.amount, each.unit) for each in told] == [(0.5, "rad"), (0.006, "m"), (0.02, "m")]
    assert told[0].axis == 2
    assert told[1].parts == ("finger_left_link", "table")
    assert told[2].seconds == 0.3
    assert "Reset in the bar" in told[2].said


def test_without_a_control_socket_nothing_is_driven(table: Table) -> None:
    window = table.join(PAGES[0])
    table.hub.drive(window.person.key)
    table.hub.leave(window)
    with pytest.raises(LeaseError, match="front page"):
        table.hub.drive(window.person.key)


def test_a_viewer_stops_the_arm_and_does_nothing_else(table: Table) -> None:
    watcher = table.join(PAGES[0], Role.VIEWER, "Vera")
    acts: list[Callable[[], None]] = [
        lambda: table.hub.drive(watcher.person.key),
        lambda: table.hub.acquire(watcher),
        lambda: table.hub.take(watcher),
        lambda: table.hub.request(watcher),
        lambda: table.hub.jog(watcher, (0.1, 0.0, 0.0, 0.0, 0.0), JogFrame.BASE),
        lambda: table.hub.set_speed(watcher, 1.0),
    ]
    for act in acts:
        with pytest.raises(LeaseError):
            act()
    assert (table.arm.holds, table.arm.stops, table.arm.share) == (0, 0, 1.0)
    table.hub.stop("Vera")
    assert table.arm.stops == 1
    with pytest.raises(LeaseError):
        table.hub.reset(watcher)
    assert table.hub.stopped is not None


def test_after_a_stop_nothing_moves_until_a_reset(table: Table) -> None:
    driver, other = (table.join(page) for page in PAGES)
    drags = {"/target/move"}
    table.hub.show(driver.person.key, FakePicture(), drags)
    table.hub.drive(driver.person.key)
    table.arm.moves = True
    table.hub.stop("Window 2")
    assert drags == set()
    assert not moves(table)
    acts: list[Callable[[], None]] = [
        lambda: table.hub.drive(driver.person.key),
        lambda: table.hub.jog(driver, (0.1, 0.0, 0.0, 0.0, 0.0), JogFrame.BASE),
    ]
    for act in acts:
        with pytest.raises(LeaseError, match="stopped"):
            act()
    # Only who drives may end it.
    with pytest.raises(LeaseError, match="Window 1 holds"):
        table.hub.reset(other)
    assert stands_still(table)
    table.hub.reset(driver)
    assert not stands_still(table)
    assert not moves(table)
    table.hub.drive(driver.person.key)


def test_a_press_of_stop_counts_once_however_late_it_is_told_again(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.stop("Window 1", "a press")
    table.hub.stop("Window 1", "a press")
    table.hub.reset(driver)
    table.hub.stop("Window 1", "a press")
    assert not stands_still(table)
    table.hub.stop("Window 1", "another")
    assert stands_still(table)
    table.hub.reset(driver)
    # Without a name every one counts.
    for _ in range(2):
        table.hub.stop("Window 1")
        assert stands_still(table)
        table.hub.reset(driver)


def test_an_arm_that_lost_its_stop_is_stopped_again(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.stop("Window 1")
    table.arm.halted, table.arm.moves = False, True
    table.wait(TICK, driver)
    assert table.arm.halted
    assert not moves(table)


class FakePicture:
    def age(self, t: float) -> float:
        return t - 100.0


def test_a_driver_who_falls_silent_while_the_arm_moves_stops_it_in_time(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.drive(driver.person.key)
    table.wait(1.0, driver)
    table.arm.moves = True
    table.wait(Settings.silence - TICK)
    assert moves(table)
    table.wait(2 * TICK)
    assert not moves(table)
    assert table.hub.stopped is not None
    assert table.hub.stopped.why == "Window 1 fell silent while the arm moved."
    # A word that comes late starts nothing anew.
    table.hub.beat(driver)
    with pytest.raises(LeaseError, match="reset"):
        table.hub.drive(driver.person.key)


def test_a_driver_who_falls_silent_at_rest_loses_the_arm_and_stops_nothing(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.drive(driver.person.key)
    table.wait(LOST_AFTER - 2 * TICK)
    assert table.hub.lease.holder == driver.person
    table.wait(3 * TICK)
    assert (table.hub.lease, table.hub.stopped) == (Lease(), None)


@pytest.mark.parametrize(
    "change",
    [
        lambda hub, driver, other: hub.hand_over(driver, other.number),
        lambda hub, _, other: hub.take(other),
        lambda hub, driver, _: hub.give_up(driver),
    ],
    ids=["handed over", "taken", "given up"],
)
def test_another_driver_finds_an_arm_that_wants_nothing(
    table: Table, change: Callable[[Hub, Window, Window], None]
) -> None:
    driver, other = (table.join(page) for page in PAGES)
    drags = {"/target/move"}
    table.hub.show(driver.person.key, FakePicture(), drags)
    table.hub.drive(driver.person.key)
    table.arm.moves = True
    change(table.hub, driver, other)
    assert not moves(table)
    assert drags == set()


def test_a_page_that_comes_back_is_who_it_was(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.join(PAGES[1])
    table.hub.drive(driver.person.key)
    table.hub.leave(driver)
    again = table.join(PAGES[0])
    assert again.person == driver.person
    table.hub.drive(again.person.key)
    # The old socket's end comes after the new one's beginning.
    fresh = table.join(PAGES[0])
    table.hub.leave(again)
    assert table.hub.window(fresh.person.key) is fresh


def test_two_browsers_with_one_link_are_two_people(table: Table) -> None:
    anna, second = (table.join(page, Role.OPERATOR, "Anna") for page in PAGES)
    assert anna.person.name == "Anna"
    assert second.person.name == "Anna (2)"
    assert anna.person != second.person


def test_a_guessed_page_of_another_session_is_somebody_else(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.drive(driver.person.key)
    stranger = Identity("another session", None, Role.ADMIN)
    with pytest.raises(LeaseError):
        table.hub.drive(key_of(stranger, PAGES[0]))


def test_a_jog_goes_on_while_it_is_held_and_is_over_by_itself(table: Table) -> None:
    driver = table.join(PAGES[0])
    forward = (0.2, 0.0, 0.0, 0.0, 0.5)
    for _ in range(5):
        table.hub.jog(driver, forward, JogFrame.TOOL)
        table.wait(0.04, driver)
    assert table.arm.jogs == [(forward, JogFrame.TOOL)] * 5
    table.hub.set_speed(driver, 0.25)
    assert table.arm.share == 0.25


def test_a_jog_that_is_let_go_says_so_to_the_arm(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.jog(driver, (0.2, 0.0, 0.0, 0.0, 0.0), JogFrame.BASE)
    table.hub.jog(driver, (0.0,) * 5, JogFrame.BASE)
    assert table.arm.jogs[-1] == ((0.0,) * 5, JogFrame.BASE)
    # A driver who jogged no more and falls silent stops nothing.
    table.wait(2 * Settings.silence)
    assert table.arm.stops == 0


def test_the_age_of_a_picture_is_that_of_the_windows_own(table: Table) -> None:
    first, second = (table.join(page) for page in PAGES)
    picture = FakePicture()
    table.hub.show(first.person.key, picture, set())
    table.t += 1.5
    assert table.hub.age(first) == pytest.approx(1.5)
    assert table.hub.age(second) == 0.0
    table.hub.hide(picture)
    assert table.hub.age(first) == 0.0


def test_before_the_arm_is_there_nobody_drives_it() -> None:
    hub = Hub(lambda: 0.0)
    window = hub.join(Identity("session", None, Role.ADMIN), PAGES[0], lambda _: None)
    with pytest.raises(LeaseError, match="not there yet"):
        hub.drive(window.person.key)
    hub.tick()
    hub.stop("Window 1")
    hub.reset(window)
