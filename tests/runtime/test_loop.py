"""The control loop on a test clock, and once on the clock of the machine."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor, CommandChannel, Person, Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.state.state import Finding, Reason, State, Status
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.drivers.driver import DriverAnswer, SimulatedDriver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import REST_PERIOD, ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.tick import TickRecord
from katana450.assembly.robot_session import find_robot
from katana450.extensions.recording.live.ring import RunEvents
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.ticks import SteppedClock

RATE = 100.0


class LoopParts:
    """A control loop and its parts."""

    def __init__(
        self, arm: ArmModel, session: Session, driver: type[SimulatedDriver] = SimulatedDriver
    ) -> None:
        self.clock = SteppedClock()
        self.mailbox = Mailbox(session.check)
        self.driver = driver(arm, session.ready, 0.0)
        self.loop = ControlLoop(session, self.driver, self.mailbox, self.clock, RATE)

    def tick(self, times: int = 1) -> None:
        for _ in range(times):
            self.clock.t += 1.0 / RATE
            self.loop.tick()

    @property
    def state(self) -> State:
        return self.loop.state_publisher.snapshot.state


@pytest.fixture
def parts(arm: ArmModel, session: Session) -> LoopParts:
    return LoopParts(arm, session)


@pytest.fixture(autouse=True)
def ordinary_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the real-time priority of a loop from the thread of all later tests."""
    monkeypatch.setattr("katana450.arm.runtime.loop.prefer_thread", lambda: None)


def test_command_moves_the_arm_to_its_goal(arm: ArmModel, parts: LoopParts) -> None:
    ticket = parts.mailbox.put(cmd.Joint(1, 0.5))
    parts.tick()
    assert parts.loop.state_publisher.snapshot.ticket == ticket
    jerk = float(arm.limits.jerk[0])
    assert parts.state.q[0] == pytest.approx(jerk / RATE**3 / 6.0)
    parts.tick(150)
    assert parts.state.q[0] == 0.5


def test_arm_at_rest_publishes_nothing(parts: LoopParts) -> None:
    parts.tick(3)
    resting = parts.loop.state_publisher.snapshot
    parts.tick(50)
    assert parts.loop.state_publisher.snapshot is resting
    parts.mailbox.put(cmd.EndDrag())
    parts.tick()
    assert parts.loop.state_publisher.snapshot is not resting


def test_first_step_after_rest_is_one_period_long(arm: ArmModel, parts: LoopParts) -> None:
    parts.tick(500)
    before = parts.state.q
    parts.mailbox.put(cmd.Joint(1, 2.0))
    parts.tick()
    step = np.abs(parts.state.q - before)
    assert step.max() == pytest.approx(float(arm.limits.jerk[0]) / RATE**3 / 6.0)


class BrokenDriver(SimulatedDriver):
    """A driver that fails while ``broken``."""

    broken = False

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        if self.broken:
            raise OSError("the cable came out")
        return super().send(q, gripper, t, stopped)


def test_bodies_are_loaded_before_the_first_tick(
    arm: ArmModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also by the thread of the loop, because each thread has its own memory of them."""
    threads: list[str] = []
    monkeypatch.setattr(
        CollisionWorld, "load", lambda _: threads.append(threading.current_thread().name)
    )
    session = find_robot(Settings(), URDF_PATH, None).session
    driver = SimulatedDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, Mailbox(session.check), MonotonicClock(), RATE)
    assert threads == [threading.current_thread().name]
    loop.start()
    loop.stop()
    assert threads[1:] == ["control"]


@pytest.fixture
def broken(arm: ArmModel, session: Session) -> LoopParts:
    """Return a loop whose driver can fail."""
    return LoopParts(arm, session, BrokenDriver)


def test_failing_driver_makes_the_arm_hold_and_report_it(
    broken: LoopParts, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken.mailbox.put(cmd.Joint(1, 2.0))
    broken.tick(5)
    moving = broken.state
    with caplog.at_level(logging.ERROR), monkeypatch.context() as failing:
        failing.setattr(broken.driver, "broken", True)
        broken.tick()
    held = broken.state
    assert held.status is Status.FAULT
    assert (held.goal == moving.setpoint).all()
    assert "the cable came out" in caplog.text
    # With the cable back in, the arm still holds until a new command comes.
    broken.tick(20)
    assert np.allclose(broken.state.q, moving.setpoint)
    assert broken.state.findings == held.findings
    broken.mailbox.put(cmd.Home())
    broken.tick()
    assert broken.state.findings == ()


def test_stop_in_a_failed_tick_is_executed_in_the_next(
    broken: LoopParts, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    press = cmd.Stop(pressed("Anna", "a", "one", 1.0))
    with monkeypatch.context() as failing:
        failing.setattr(broken.driver, "broken", True)
        broken.mailbox.put(press)
        broken.tick(2)
        assert broken.state.stopped is None
    # A copy of the press by another path is no second stop.
    broken.mailbox.put(press)
    broken.mailbox.put(cmd.Joint(1, 2.0))
    broken.tick(20)
    state = broken.state
    assert state.stopped is not None
    assert (state.stopped.cause.why, state.presses) == ("Anna pressed STOP.", ("one",))
    np.testing.assert_array_equal(state.q, session.ready)


def test_copy_of_a_press_names_who_pressed_and_stops_nothing(parts: LoopParts) -> None:
    records: list[TickRecord] = []
    parts.loop.record = records.append
    parts.mailbox.put(cmd.Stop(pressed("Somebody", "a/page", "one", 1.0)))
    parts.tick()
    for whose, press in (("b/page", "one"), ("a/page", "two")):
        parts.mailbox.put(cmd.Stop(pressed("Anna", whose, press, 2.0)))
        parts.tick(10)
    first = parts.state.stopped
    assert first is not None
    assert first.cause.by == "Somebody"
    parts.mailbox.put(cmd.Stop(pressed("Anna", "a/page", "one", 2.0)))
    parts.tick()
    stopped = parts.state.stopped
    assert stopped == replace(first, cause=pressed("Anna", "a/page", "one", 1.0))
    # The late copy of the first process does not take the name away.
    parts.mailbox.put(cmd.Stop(pressed("Somebody", "a/page", "one", 1.0)))
    parts.tick()
    assert parts.state.stopped == stopped
    events = RunEvents()
    assert [event for record in records for event in events.of(record)][-1] == (
        "stop", {"why": "Anna pressed STOP.", "by": "Anna", "named": True}
    )  # fmt: skip


def test_simulated_arm_is_at_once_where_it_was_in_a_restored_state(parts: LoopParts) -> None:
    parts.mailbox.put(cmd.Joint(1, 2.0))
    parts.mailbox.put(cmd.Gripper(0.4))
    parts.tick(60)
    moment, course = parts.state, list[list[float]]()
    parts.tick()
    course += [parts.state.q.tolist()]
    parts.tick(200)
    parts.mailbox.put(cmd.RestoreState(moment))
    parts.tick()
    assert parts.state.q.tolist() == course[0]
    assert parts.state.gripper == parts.state.gripper_setpoint
    np.testing.assert_array_equal(parts.state.q, parts.state.setpoint)


def test_only_after_a_silent_server_a_program_resumes_by_itself(parts: LoopParts) -> None:
    program = Actor(Person("a key", "Anna", Role.OPERATOR), CommandChannel.PROGRAM)
    parts.loop.profile = SilenceProfile.SIMULATION
    for reason, goal in ((Reason.LOOP_LATE, None), (Reason.SERVER_SILENT, 2.0)):
        parts.mailbox.put(cmd.Joint(1, 2.0), program)
        parts.tick(30)
        parts.loop.brake(Finding(reason, 0.3), 0.3)
        parts.tick(200)
        state = parts.state
        assert not state.moving
        # A hold drops the goal; a pause keeps it until the program goes on.
        assert state.goal[0] == (state.q[0] if goal is None else goal) != 0.0


def test_wait_for_change_returns_on_change_or_timeout(parts: LoopParts) -> None:
    parts.tick()
    before = parts.loop.state_publisher.snapshot
    assert parts.loop.state_publisher.wait_for_change(before, 0.01) is before
    parts.mailbox.put(cmd.Home())
    thread = threading.Thread(target=parts.tick)
    thread.start()
    assert parts.loop.state_publisher.wait_for_change(before, 5.0) is not before
    thread.join()


def test_wake_ends_a_wait_for_change(parts: LoopParts) -> None:
    parts.tick()
    publisher = parts.loop.state_publisher
    before, after = publisher.snapshot, []
    ended = threading.Event()
    thread = threading.Thread(
        target=lambda: after.append(publisher.wait_for_change(before, 60.0, ended.is_set))
    )
    thread.start()
    publisher.wake()
    thread.join(0.05)
    assert thread.is_alive()
    ended.set()
    publisher.wake()
    thread.join(30.0)
    assert after == [before]


class ClockOfPresses(SteppedClock):
    """A clock on which somebody presses STOP during each sleep that STOP can end."""

    def __init__(self, loops: int) -> None:
        super().__init__()
        self.press: Callable[[], object] = bool
        self.end: Callable[[], object] = bool
        self.left = loops

    def sleep_until(self, t: float, wake: threading.Event | None = None) -> None:
        if wake is None:
            self.t = t
            return
        self.left -= 1
        if self.left == 0:
            self.end()
        self.t = t - 0.9 / RATE
        self.press()
        if not wake.is_set():
            self.t = t


def test_stop_does_not_wait_for_the_next_tick(arm: ArmModel, session: Session) -> None:
    clock, mailbox = ClockOfPresses(3), Mailbox(session.check)
    times: list[float] = []
    loop = ControlLoop(session, SimulatedDriver(arm, session.ready, 0.0), mailbox, clock, RATE)

    def press() -> None:
        if not times:
            times.append(clock.t)
            mailbox.put(cmd.Stop(pressed("Anna", "a", "one", 1.0)))

    clock.press, clock.end = press, loop._stopping.set
    loop._run()
    state = loop.state_publisher.snapshot.state
    assert state.stopped is not None
    assert state.t == times[0]


def test_flood_of_stops_adds_at_most_one_tick_per_period(arm: ArmModel, session: Session) -> None:
    clock, mailbox = ClockOfPresses(10), Mailbox(session.check)
    loop = ControlLoop(session, SimulatedDriver(arm, session.ready, 0.0), mailbox, clock, RATE)
    numbers = iter(range(1000))

    def press() -> None:
        for _ in range(5):
            mailbox.put(cmd.Stop(pressed("Anna", "a", f"{next(numbers)}", 1.0)))

    clock.press, clock.end = press, loop._stopping.set
    start = clock.t
    loop._run()
    assert loop.state_publisher.snapshot.state.stopped is not None
    assert loop.ticks <= 2 * round((clock.t - start) * RATE)


def test_arm_at_rest_ticks_seldom_and_moves_at_once(arm: ArmModel, session: Session) -> None:
    clock, mailbox = ClockOfPresses(12), Mailbox(session.check)
    loop = ControlLoop(session, SimulatedDriver(arm, session.ready, 0.0), mailbox, clock, RATE)
    times: list[float] = []
    states = []

    def give() -> None:
        states.append(loop.state_publisher.snapshot.state)
        if clock.left == 6:
            times.append(clock.t)
            mailbox.put(cmd.Joint(1, 0.4))

    clock.press, clock.end = give, loop._stopping.set
    start = clock.t
    loop._run()
    # One period, and five rests, the last of which the command cuts short.
    assert times[0] - start == pytest.approx(5 * REST_PERIOD + 0.1 / RATE)
    moving = states[6]
    assert moving.t == times[0]
    # The first step is that of one period, however long the arm rested.
    step = float(np.abs(moving.setpoint - states[0].setpoint).max())
    assert step == pytest.approx(float(arm.limits.jerk[0]) / RATE**3 / 6.0)
    assert states[7].t - moving.t == pytest.approx(1 / RATE)


def test_loop_runs_and_stops_on_the_machine_clock(arm: ArmModel, session: Session) -> None:
    mailbox = Mailbox(session.check)
    driver = SimulatedDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, mailbox, MonotonicClock(), RATE)
    loop.start()
    started = time.perf_counter()
    mailbox.put(cmd.Joint(1, 0.4))
    snapshot = loop.state_publisher.snapshot
    while snapshot.state.q[0] != 0.4:
        assert time.perf_counter() - started < 10.0
        snapshot = loop.state_publisher.wait_for_change(snapshot, 0.1)
    took = time.perf_counter() - started
    loop.stop()
    # Even with late ticks the joint must not arrive earlier than its limits allow.
    assert took >= 0.4 / arm.chain.speed[0] - 1.5 / RATE
    assert not [thread for thread in threading.enumerate() if thread.name == "control"]
