"""The control loop: a fixed number of ticks per second, fewer at rest, and one more for a STOP."""

from __future__ import annotations

import logging
import math
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace

from katana450.arm.control.commands.commands import OperateArm, Stop
from katana450.arm.control.lease import CommandChannel
from katana450.arm.control.session.checks import DROPPED
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import SilenceProfile, with_name
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import ACCEPTED, Finding, Reason, State, Verdict
from katana450.arm.drivers.driver import Driver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.mailbox import Drained, Mailbox
from katana450.arm.runtime.pipes.state_publisher import (
    LoopTiming,
    Punctuality,
    Snapshot,
    StatePublisher,
    TicketOutcome,
)
from katana450.arm.runtime.tick import TickRecord, driven, failed, restores, waited
from katana450.platform_support import prefer_thread

log = logging.getLogger(__name__)

REST_PERIOD = 0.08
"""[s] Time between two ticks of a robot at rest, which the next command cuts short; not on Windows,
where no command can end a sleep that is exact.
"""


class ControlLoop:
    """The control loop: each tick drains the mailbox, steps, sends the setpoint and publishes."""

    def __init__(
        self,
        session: Session,
        driver: Driver,
        mailbox: Mailbox,
        clock: MonotonicClock,
        rate: float,
        held_up: float = math.inf,
        first: Callable[[State], State] | None = None,
        profile: SilenceProfile = SilenceProfile.REAL_ARM,
    ) -> None:
        """Create the loop, and start the driver.

        Args:
            session: the rules of the robot.
            driver: the connection to the arm.
            mailbox: the source of commands.
            clock: the clock of the ticks.
            rate: ticks per second [Hz].
            held_up: lateness of a tick [s] for which a moving arm brakes, because the loop did not
                supervise it meanwhile.
            first: makes the first state from that with which the session begins; None keeps it.
            profile: reaction of a moving arm to lateness and silence.
        """
        self._session = session
        self._driver = driver
        self._mailbox = mailbox
        self._clock = clock
        self._period = 1.0 / rate
        self._held_up = held_up
        self.profile = profile
        self.paused_at = -math.inf
        """Time of the newest command with which the arm's process itself brakes the arm [s]."""
        # It takes longer than a tick.
        self._load()
        t = clock.now()
        sent = driver.start(t)
        first_state = session.begin(sent.q, sent.gripper, t)
        self._state = first_state if first is None else first(first_state)
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._punctuality = Punctuality(self._period)
        self._program_drives = False
        self.state_publisher = StatePublisher(Snapshot(self._state, 0), self.loop_timing)
        """Publisher of the states of the loop."""
        self.ticks = 0
        """Number of completed ticks."""
        self.record: Callable[[TickRecord], None] | None = None
        """Takes the record of each tick, in the control thread; it must return at once."""
        self._resting = self._settled = False

    @property
    def loop_timing(self) -> LoopTiming:
        """Timing of the last ticks."""
        return self._punctuality.loop_timing

    def tick(self) -> None:
        """Execute one tick: take the commands, step, send the setpoint, publish changes."""
        drained = self._mailbox.drain()
        for submission in drained.submissions:
            if any(part.traits.supersedes for part in submission.command.parts):
                actor = submission.actor
                self._program_drives = actor is not None and actor.channel is CommandChannel.PROGRAM
        before = self._state
        t = self._clock.now()
        if self._resting and drained.submissions:
            # Commands apply from now on, and not since the last tick, which may be long ago.
            before = replace(before, t=max(before.t, t - self._period))
        commands, has_failed = drained.commands, False
        is_given = drained.last != self.state_publisher.snapshot.ticket
        try:
            if self._settled and not is_given:
                state = waited(self._session, before, t, self._driver.send)
            else:
                state = self._session.step(before, commands, t)
                if restores(commands, state):
                    self._driver.place(state.q, state.gripper)
                state = driven(self._session, state, t, self._driver.send)
        except Exception:
            # The loop continues after any error and the arm holds: the state reports the error.
            log.exception("The control loop met an error; the arm holds.")
            state, has_failed = failed(before, commands), True
            self._put_stops_again(drained)
        nameless, state = state, with_name(state, drained.repeated.values())
        self._state = state
        for command, outcome in zip(commands, state.outcomes, strict=False):
            if isinstance(command, Stop):
                self._driver.freeze(t)
            elif isinstance(command, OperateArm) and outcome.verdict is not Verdict.REFUSED:
                self._driver.perform(command.act, t)
        if self.record is not None and state is not before:
            named = state is not nameless
            self.record(TickRecord(before.t, t, drained.submissions, has_failed, state, named))
        # A state that differs only in its time is not published.
        changed = is_given or _differs(before, state)
        self._resting = not (changed or state.moving or state.objects_move)
        # Only time has passed, and nothing waits for it.
        self._settled = self._resting and not (state.under_way or state.blocked)
        if changed:
            self.state_publisher.note(_outcomes(drained, state))
            self.state_publisher.publish(Snapshot(state, drained.last))
        self.ticks += 1

    def _put_stops_again(self, drained: Drained) -> None:
        """Leave each stop of the failed tick for the next tick: a stop is never lost."""
        for command, actor in drained.submissions:
            if isinstance(command, Stop):
                # Without a name it counts again, although the mailbox knows its presses.
                cause = replace(command.cause, press="")
                self._mailbox.put(Stop(cause, command.finding, command.presses), actor)

    @property
    def running(self) -> bool:
        """True if the thread runs; False once it has ended for any reason."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Run the ticks in a thread of their own until ``stop``."""
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and stop the driver."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
        self._driver.stop()

    def brake(self, cause: Finding, silence: float) -> None:
        """Stop or pause a moving arm after ``silence`` [s], for the reason ``cause``."""
        state = self.state_publisher.snapshot.state
        resumes = self._program_drives and cause.reason is Reason.SERVER_SILENT
        command = self.profile.braking(cause, silence, resumes=resumes)
        latched, halted = isinstance(command, Stop), state.waits or state.pause_cause is not None
        if state.stopped is not None or not (state.moving or (latched and halted)):
            return
        if halted and not latched:
            return
        log.error("%s: %s.", "STOP" if latched else "Paused", finding_text(cause))
        self.paused_at = self._clock.now()
        self._mailbox.put(command)

    def _load(self) -> None:
        """Prepare this thread to measure distances."""
        if self._session.world is not None:
            self._session.world.load()

    def _run(self) -> None:
        prefer_thread()
        self._load()
        due = self._clock.now()
        while not self._stopping.is_set():
            late = self._clock.now() - due
            self._punctuality.note(late)
            if late > self._held_up:
                self.brake(Finding(Reason.LOOP_LATE, late), late)
            if late > self._period:
                # Skip lost ticks: the next step covers the time that passed.
                due += late
            self.tick()
            due += self._period
            if self._resting and sys.platform != "win32":
                due += REST_PERIOD - self._period
                self._clock.sleep_until(due, self._mailbox.command_waits)
                due = min(due, self._clock.now())
                continue
            self._clock.sleep_until(due, self._mailbox.stop_waits)
            if self._mailbox.stop_waits.is_set():
                # A STOP does not wait for the next tick. One extra tick per period, so that a
                # flood of STOP does not hurry the loop.
                self.tick()
                self._clock.sleep_until(due)


def _outcomes(drained: Drained, state: State) -> Iterator[TicketOutcome]:
    """Yield the outcome of each ticket of ``drained`` in the tick that ended in ``state``."""
    for ticket in drained.dropped:
        yield ticket, DROPPED
    for ticket in drained.repeated:
        yield ticket, ACCEPTED
    for tickets, outcome in zip(drained.tickets, state.outcomes, strict=False):
        for ticket in tickets:
            yield ticket, outcome


def _differs(a: State, b: State) -> bool:
    return (
        a.q is not b.q
        or a.gripper != b.gripper
        or a.setpoint is not b.setpoint
        or a.gripper_setpoint != b.gripper_setpoint
        or a.goal is not b.goal
        or a.mode is not b.mode
        or a.findings != b.findings
        or a.objects is not b.objects
        or a.poured is not b.poured
        or (a.report and a.report.mode) is not (b.report and b.report.mode)
    )
