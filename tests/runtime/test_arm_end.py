"""The two ends of the pipe: the arm's end with a real control loop, and the front end."""

from __future__ import annotations

import multiprocessing
import os
import socket
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session import stopping
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import SilenceProfile, clear_refusal
from katana450.arm.control.state.state import Finding, Outcome, Reason, Verdict
from katana450.arm.drivers.driver import SimulatedDriver
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import CAPACITY, Mailbox
from katana450.arm.runtime.pipes.arm_end import ArmEnd, CommandMessage
from katana450.arm.runtime.pipes.arm_roles import FRONT
from katana450.arm.runtime.pipes.front_end import FrontEnd
from katana450.arm.runtime.pipes.private_listener import Greeting
from katana450.arm.runtime.pipes.state_publisher import MAX_KEPT_OUTCOMES, Outcomes
from katana450.assembly import arm_process
from katana450.assembly.arm_process import RunningArm
from katana450.assembly.robot_session import DescribedRobot
from katana450.errors import InputError
from katana450.settings import Settings
from tests.waiting import until

SILENCE = 0.3


class Ends:
    """Both ends of the pipe, and the control loop."""

    def __init__(
        self,
        arm: ArmModel,
        session: Session,
        profile: SilenceProfile = SilenceProfile.REAL_ARM,
    ) -> None:
        self.session = session
        self.mailbox = Mailbox(session.check)
        driver = SimulatedDriver(arm, session.ready, 0.0)
        self.loop = ControlLoop(
            session, driver, self.mailbox, MonotonicClock(), 100.0, profile=profile
        )
        self.loop.start()
        self.arm_end, self.front = self.connect()

    def connect(self) -> tuple[ArmEnd, FrontEnd]:
        """Return a new arm end and a new front end, connected by a pipe."""
        ours, theirs = multiprocessing.Pipe()
        self.theirs = theirs
        arm_end = ArmEnd(ours, self.loop, self.mailbox, SILENCE)
        arm_end.start()
        front = FrontEnd(theirs, self.session.check)
        front.start()
        return arm_end, front


@pytest.fixture
def ends(arm: ArmModel, session: Session) -> Iterator[Ends]:
    ends = Ends(arm, session)
    yield ends
    ends.arm_end.close()
    ends.loop.stop()


def clear_stop(front: FrontEnd) -> int:
    """Clear the stop once that is possible; return the ticket."""

    def may_clear() -> bool:
        front.heartbeat()
        state = front.state_publisher.snapshot.state
        return not clear_refusal(state, MonotonicClock().now())

    until(may_clear)
    return front.deliver(cmd.ClearStop())


def test_started_front_end_has_the_newest_state(ends: Ends) -> None:
    ours, theirs = multiprocessing.Pipe()
    arm_end = ArmEnd(ours, ends.loop, ends.mailbox, SILENCE)
    arm_end.start()
    slow = FrontEnd(theirs, ends.session.check)
    ends.front.deliver(cmd.Stop())
    until(lambda: ends.loop.state_publisher.snapshot.state.stopped is not None)
    until(theirs.poll)
    time.sleep(0.05)
    newest: list[bool] = [slow.state_publisher.snapshot.state.stopped is not None]
    slow.start()
    newest.append(slow.state_publisher.snapshot.state.stopped is not None)
    assert newest == [False, True]
    arm_end.close()


def test_arm_that_has_just_ended_is_not_young(ends: Ends) -> None:
    ours, theirs = multiprocessing.Pipe()
    arm_end = ArmEnd(ours, ends.loop, ends.mailbox, SILENCE)
    arm_end.start()
    # No thread reads the end of the pipe yet.
    front = FrontEnd(theirs, ends.session.check)
    with socket.socket(fileno=os.dup(ours.fileno())) as line:
        line.shutdown(socket.SHUT_RDWR)
    time.sleep(0.01)
    assert theirs.poll()
    assert front.age > 0.01
    # Its command is not sent, and will be reported as dropped.
    front.deliver(cmd.Joint(1, 1.0))
    assert len(front._unsent) == 1
    with pytest.raises(InputError, match="only STOP"):
        front.deliver(cmd.Joint(1, 1.0))
    arm_end.close()


def test_arm_that_moves_at_once_was_at_rest(ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    # The front end is silent here for as long as the machine is busy.
    monkeypatch.setattr(ends.arm_end, "_silence_timeout", 60.0)
    front, calls, flush = ends.front, [], ends.front._flush
    front.on_command_at_rest = lambda: calls.append(True)

    def slow() -> None:
        flush()
        until(lambda: front.state_publisher.snapshot.ticket == 1)

    monkeypatch.setattr(front, "_flush", slow)
    front.deliver(cmd.Joint(1, 1.0))
    assert calls


def test_command_crosses_the_pipe_and_its_ticket_returns(ends: Ends) -> None:
    tickets = [ends.front.deliver(cmd.Joint(axis + 1, 0.1)) for axis in (0, 4, 0)]
    assert tickets == [1, 2, 3]
    assert ends.front.last_ticket == 3
    until(lambda: ends.front.state_publisher.snapshot.ticket == 3)
    wait_with_heartbeats(ends, lambda: not ends.front.state_publisher.snapshot.state.moving)
    state = ends.front.state_publisher.snapshot.state
    assert (state.q[0], state.q[4]) == (0.1, 0.1)
    np.testing.assert_array_equal(state.q, ends.loop.state_publisher.snapshot.state.q)


def wait_with_heartbeats(ends: Ends, true: Callable[[], bool]) -> None:
    """Wait for ``true``, and send heartbeats meanwhile."""

    def beat_and_check() -> bool:
        ends.front.heartbeat()
        return true()

    until(beat_and_check)


def test_unsupported_command_is_refused_before_the_pipe(ends: Ends) -> None:
    with pytest.raises(InputError, match="no axis 9"):
        ends.front.deliver(cmd.Joint(9, 0.1))
    assert ends.front.last_ticket == 0


def test_arm_that_hangs_gets_no_command_but_stop(
    ends: Ends, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FrontEnd, "age", 0.6)
    with pytest.raises(InputError, match=r"not answered for 0\.6 s: only STOP"):
        ends.front.deliver(cmd.Joint(1, 0.1))
    ends.front.deliver(cmd.Stop())
    until(lambda: ends.loop.state_publisher.snapshot.state.stopped is not None)


def test_ticket_of_a_dropped_command_still_advances(ends: Ends) -> None:
    for _ in range(3000):
        ends.front.deliver(cmd.Home())
    until(lambda: ends.front.state_publisher.snapshot.ticket == 3000)


def test_silent_front_end_stops_a_moving_arm(ends: Ends) -> None:
    time.sleep(2 * SILENCE)
    assert ends.loop.state_publisher.snapshot.state.stopped is None
    ends.front.deliver(cmd.Joint(1, 2.0))
    began = time.monotonic()
    until(lambda: ends.loop.state_publisher.snapshot.state.stopped is not None)
    assert SILENCE < time.monotonic() - began < 2 * SILENCE
    until(lambda: not ends.loop.state_publisher.snapshot.state.moving)


def test_silent_front_end_pauses_a_simulated_arm(
    arm: ArmModel, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopping, "PAUSE_TIMEOUT", 1.0)
    ends = Ends(arm, session, SilenceProfile.SIMULATION)
    front, publisher = ends.front, ends.loop.state_publisher
    assert front.profile is SilenceProfile.SIMULATION
    front.deliver(cmd.Joint(1, 2.0))
    until(lambda: publisher.snapshot.state.waits)
    until(lambda: front.state_publisher.snapshot.state.waits)
    until(lambda: not publisher.snapshot.state.moving)
    assert publisher.snapshot.state.stopped is None
    # The next command moves the arm.
    front.deliver(cmd.Joint(1, 1.0))
    wait_with_heartbeats(ends, lambda: publisher.snapshot.state.q[0] == 1.0)
    assert not publisher.snapshot.state.waits
    # Longer silence latches the stop.
    front.deliver(cmd.Joint(1, -2.0))
    until(lambda: publisher.snapshot.state.stopped is not None)
    assert Reason.SERVER_SILENT in {finding.reason for finding in publisher.snapshot.state.findings}
    ends.arm_end.close()
    ends.loop.stop()


def test_command_older_than_a_pause_is_refused(arm: ArmModel, session: Session) -> None:
    ends = Ends(arm, session, SilenceProfile.SIMULATION)
    front, publisher = ends.front, ends.loop.state_publisher
    front.deliver(cmd.Joint(1, 2.0))
    wait_with_heartbeats(ends, lambda: publisher.snapshot.state.moving)
    ends.loop.brake(Finding(Reason.LOOP_LATE, 0.3), 0.3)
    # The front end does not know of the pause yet.
    ends.theirs.send(CommandMessage(99, cmd.Joint(1, 2.0), None, ends.loop.paused_at - 0.01))
    wait_with_heartbeats(ends, lambda: publisher.snapshot.state.waits)
    wait_with_heartbeats(ends, lambda: not publisher.snapshot.state.moving)
    assert publisher.snapshot.state.waits
    assert "just paused" in front.state_publisher.outcomes.of(99).result(5.0).why
    ends.arm_end.close()
    ends.loop.stop()


def test_broken_pipe_stops_the_arm_and_a_new_front_end_moves_nothing(ends: Ends) -> None:
    ends.front.deliver(cmd.Joint(1, 2.0))
    wait_with_heartbeats(ends, lambda: ends.front.state_publisher.snapshot.state.moving)
    with socket.socket(fileno=os.dup(ends.theirs.fileno())) as line:
        line.shutdown(socket.SHUT_RDWR)
    until(ends.arm_end.cut.is_set, 2.0)
    until(lambda: ends.loop.state_publisher.snapshot.state.stopped is not None)
    ends.arm_end, again = ends.connect()
    assert again.state_publisher.snapshot.state.stopped is not None
    until(lambda: not again.state_publisher.snapshot.state.moving)
    clear_stop(again)
    until(lambda: again.state_publisher.snapshot.state.stopped is None)
    q = again.state_publisher.snapshot.state.q
    time.sleep(0.2)
    np.testing.assert_array_equal(again.state_publisher.snapshot.state.q, q)


def test_loop_timing_is_reported_periodically(ends: Ends) -> None:
    until(lambda: ends.front.state_publisher.loop_timing.ticks > 50)
    assert ends.front.state_publisher.loop_timing.period == 0.01


def test_outcomes_return_with_the_tickets_of_the_front_end(ends: Ends) -> None:
    front, wait = ends.front, 5.0
    outcomes = front.state_publisher.outcomes
    fine, far = front.deliver(cmd.Joint(1, 0.1)), front.deliver(cmd.Joint(2, 99.0))
    assert outcomes.of(fine).result(wait).verdict is Verdict.ACCEPTED
    limited = outcomes.of(far).result(wait)
    assert limited.verdict is Verdict.LIMITED
    assert [finding.axis for finding in limited.findings] == [1]
    # The front end has not seen this stop yet, as when the arm's end lost contact.
    ends.mailbox.put(cmd.Stop())
    late = outcomes.of(front.deliver(cmd.Joint(1, 0.2))).result(wait)
    assert late.verdict is Verdict.REFUSED
    assert "clear the stop first" in late.why
    # The outcome of this ticket is recorded before the test reads it.
    assert outcomes.of(fine).result(wait).verdict is Verdict.ACCEPTED
    both = front.deliver(cmd.Batch((cmd.Joint(1, 0.2), cmd.Speed(0.5))))
    assert outcomes.of(both).result(wait).verdict is Verdict.LIMITED
    early = outcomes.of(front.deliver(cmd.ClearStop())).result(wait)
    assert early.verdict is Verdict.REFUSED
    assert "Clear the stop" in early.why
    assert outcomes.of(clear_stop(front)).result(wait).verdict is Verdict.ACCEPTED


def test_numbers_of_displaced_outcomes_are_dropped(
    ends: Ends, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The loop, which reports states, does not run.
    monkeypatch.setattr("katana450.arm.runtime.pipes.front_end.COMMAND_TIMEOUT", 60.0)
    ends.loop.stop()
    count = MAX_KEPT_OUTCOMES + 5
    # Each command replaces the one before, so that one tick reports all outcomes.
    tickets = [ends.front.deliver(cmd.Joint(1, 1e-4 * k)) for k in range(count)]

    def all_arrived() -> bool:
        # A heartbeat first sends the commands that found the pipe full.
        ends.front.heartbeat()
        return ends.mailbox.last_ticket == count

    until(all_arrived)
    ends.loop.tick()
    # The driver is stopped, so the commands fail; their outcome is reported nevertheless.
    newest = ends.front.state_publisher.outcomes.of(tickets[-1]).result(5.0)
    assert newest.verdict is Verdict.REFUSED
    assert not ends.arm_end._number_of


def test_command_for_a_full_mailbox_is_refused(ends: Ends) -> None:
    ends.loop.stop()
    for _ in range(CAPACITY):
        ends.mailbox.put(cmd.Home())
    ticket = ends.front.deliver(cmd.Home())
    time.sleep(0.2)
    ends.loop.tick()
    outcome = ends.front.state_publisher.outcomes.of(ticket).result(5.0)
    assert outcome.verdict is Verdict.REFUSED
    assert "slower" in outcome.why


def test_front_end_connects_to_a_new_process_of_the_arm(arm: ArmModel, session: Session) -> None:
    old, new = Ends(arm, session), Ends(arm, session)
    pipes: list[Connection] = []
    numbers: list[int] = []

    def reconnect(number: int) -> Connection:
        numbers.append(number)
        if not pipes:
            raise ConnectionRefusedError
        return pipes.pop()

    ours, theirs = multiprocessing.Pipe()
    arm_end = ArmEnd(ours, old.loop, old.mailbox, SILENCE)
    arm_end.start()
    front = FrontEnd(theirs, session.check, reconnect)
    front.start()
    front.deliver(cmd.Joint(1, 2.0))
    until(lambda: front.state_publisher.snapshot.ticket == 1)
    # The end of the process closes its end of the pipe.
    with socket.socket(fileno=os.dup(ours.fileno())) as line:
        line.shutdown(socket.SHUT_RDWR)
    until(lambda: bool(numbers))
    assert front.age > 0.0
    with pytest.raises(InputError, match="only STOP"):
        front.deliver(cmd.Joint(1, 1.0))
    stop = front.deliver(cmd.Stop())
    until(lambda: numbers[-1] == stop)
    ours, theirs = multiprocessing.Pipe()
    later = ArmEnd(ours, new.loop, new.mailbox, SILENCE, numbers[-1])
    later.start()
    pipes.append(theirs)
    until(lambda: front.state_publisher.snapshot.ticket == stop)
    # No command to the process that ended has reached the new one.
    assert new.mailbox.last_ticket == 0
    assert front.last_ticket == stop
    ticket = front.deliver(cmd.Joint(1, 0.1))
    until(lambda: front.state_publisher.snapshot.ticket == ticket)
    # Another front end replaces this one.
    later.close()
    assert front.cut.wait(2.0)
    for both in (old, new):
        both.arm_end.close()
        both.loop.stop()


OUTCOME = Outcome(Verdict.ACCEPTED)


def test_all_futures_of_a_ticket_receive_its_outcome() -> None:
    outcomes = Outcomes()
    first, cancelled, last = (outcomes.of(7) for _ in range(3))
    cancelled.cancel()
    assert not first.done()
    outcomes.note([(7, OUTCOME)])
    assert first.result(0.0) is OUTCOME
    assert last.result(0.0) is OUTCOME
    assert outcomes.of(7).result(0.0) is OUTCOME


class Again:
    """A front end that connects again to its arm."""

    def __init__(self, arm: ArmModel, session: Session) -> None:
        self.ends = Ends(arm, session)
        self.arm_ends: list[ArmEnd] = []
        self.front = FrontEnd(self.connection(), session.check, self.connection)

    def connection(self, number: int = 0) -> Connection:
        ours, theirs = multiprocessing.Pipe()
        self.arm_ends.append(ArmEnd(ours, self.ends.loop, self.ends.mailbox, SILENCE, number))
        self.arm_ends[-1].start()
        return theirs

    def works_by_a_second_pipe(self) -> None:
        until(lambda: len(self.arm_ends) == 2 and self.front.age < SILENCE)
        assert self.arm_ends[0].cut.is_set()
        ticket = clear_stop(self.front)
        until(lambda: self.front.state_publisher.snapshot.ticket == ticket)
        for arm_end in (self.ends.arm_end, *self.arm_ends):
            arm_end.close()
        self.ends.loop.stop()


@pytest.mark.parametrize("name", ["_outcomes", "_put"])
def test_error_in_a_thread_of_the_arm_closes_the_pipe(
    arm: ArmModel, session: Session, name: str
) -> None:
    again = Again(arm, session)

    def fail(*_: object) -> None:
        raise RuntimeError("dictionary changed size during iteration")

    setattr(again.arm_ends[0], name, fail)
    again.front.start()
    again.front.deliver(cmd.Joint(1, 1.0))
    # No command can come any more, so the arm stops.
    until(lambda: again.front.state_publisher.snapshot.state.stopped is not None)
    again.works_by_a_second_pipe()


def test_error_in_the_thread_of_the_front_end_closes_the_pipe(
    arm: ArmModel, session: Session
) -> None:
    again = Again(arm, session)

    def fail() -> None:
        again.front.on_stop_change = lambda: None
        raise RuntimeError("a callback met an error")

    again.front.on_stop_change = fail
    again.front.start()
    again.front.deliver(cmd.Stop())
    again.works_by_a_second_pipe()


def test_arm_ends_stopped_and_at_rest_although_a_command_has_just_arrived(
    robot: Robot, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The priority of this process stays.
    monkeypatch.setattr(arm_process, "raise_priority", lambda: None)
    arm = RunningArm(Settings(), DescribedRobot(robot, session, ()))
    arm.start()
    ours, theirs = multiprocessing.Pipe()
    arm.attach(ours, Greeting(FRONT))
    front = FrontEnd(theirs, session.check)
    front.start()
    front.deliver(cmd.Joint(1, 2.0))
    arm.stop()
    state = arm.state_publisher.snapshot.state
    assert (state.stopped is not None, state.moving, arm.running) == (True, False, False)
    np.testing.assert_array_equal(state.q, state.setpoint)
    assert front.cut.wait(5.0)
    # The front end is disconnected, and sees no stop that nobody pressed.
    assert front.state_publisher.snapshot.state.stopped is None
    theirs.close()
