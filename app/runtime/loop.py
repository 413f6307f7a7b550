"""The control loop: a fixed number of ticks a second, whatever the view does."""

from __future__ import annotations

import logging
import threading
from collections import deque
from dataclasses import dataclass

from app.control.ledger import Entry, news
from app.control.session import Session
from app.control.state import State
from app.drivers.driver import Driver
from app.runtime.clock import Clock
from app.runtime.lateness import Lateness, Punctuality
from app.runtime.mailbox import Mailbox

KEPT = 500
"""Entries of the ledger that are kept."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What the loop shows the world: a state, and the last mailbox ticket that is in it."""

    state: State
    ticket: int


class ControlLoop:
    """Drain, step, send, publish."""

    def __init__(
        self, session: Session, driver: Driver, mailbox: Mailbox, clock: Clock, rate: float
    ) -> None:
        """``rate``: ticks a second [Hz]."""
        self._session = session
        self._driver = driver
        self._mailbox = mailbox
        self._clock = clock
        self._period = 1.0 / rate
        t = clock.now()
        sent = driver.start(t)
        self._state = session.begin(sent.q, sent.gripper, t)
        self._snapshot = Snapshot(self._state, 0)
        self._published = threading.Condition()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._ledger: deque[Entry] = deque(maxlen=KEPT)
        self._punctuality = Punctuality(self._period)

    @property
    def snapshot(self) -> Snapshot:
        """The newest one."""
        return self._snapshot

    @property
    def ledger(self) -> tuple[Entry, ...]:
        """The last reasons why the arm did not do what was wished, oldest first."""
        return tuple(self._ledger)

    @property
    def lateness(self) -> Lateness:
        """How well the ticks come when they are due."""
        return self._punctuality.lateness

    def wait_for_change(self, seen: Snapshot, timeout: float) -> Snapshot:
        """The newest snapshot, as soon as it is another than ``seen`` or ``timeout`` [s] is up."""
        with self._published:
            self._published.wait_for(lambda: self._snapshot is not seen, timeout)
            return self._snapshot

    def wait_for_command(self, seen: Snapshot, timeout: float) -> None:
        """Return as soon as a command newer than ``seen`` is in, or ``timeout`` [s] is up."""
        with self._published:
            self._published.wait_for(lambda: self._snapshot.ticket != seen.ticket, timeout)

    def tick(self) -> None:
        """One turn: take the commands, move on, tell the arm, publish what changed."""
        commands, ticket = self._mailbox.drain()
        before = self._state
        t = self._clock.now()
        try:
            state = self._session.step(before, commands, t)
            sent = self._driver.send(state.setpoint, state.gripper_setpoint, t)
            state = self._session.observe(state, sent.q, sent.gripper)
        except Exception:
            # Whatever went wrong, the loop lives on and the arm holds: a person must see it.
            log.exception("The control loop met an error; the arm holds.")
            state = self._session.fail(before)
        self._state = state
        self._ledger.extend(news(before, state))
        # An arm at rest wakes nobody: time alone is no news.
        if commands or _differs(before, state):
            with self._published:
                self._snapshot = Snapshot(state, ticket)
                self._published.notify_all()

    def start(self) -> None:
        """Run the ticks in a thread of their own until ``stop``."""
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and let go of the arm."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
        self._driver.stop()

    def _run(self) -> None:
        due = self._clock.now()
        while not self._stopping.is_set():
            late = self._clock.now() - due
            self._punctuality.note(late)
            if late > self._period:
                # Do not run after lost ticks: the session moves by the time that passed.
                due += late
            self.tick()
            due += self._period
            self._clock.sleep_until(due)


def _differs(a: State, b: State) -> bool:
    return (
        a.q is not b.q
        or a.gripper != b.gripper
        or a.setpoint is not b.setpoint
        or a.gripper_setpoint != b.gripper_setpoint
        or a.goal is not b.goal
        or a.target is not b.target
        or a.findings != b.findings
    )
