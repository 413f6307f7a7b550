"""Where the control loop shows what it does, to whoever looks, in this process or another."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.state import State
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.outcomes import Outcomes, TicketOutcome

MAX_KEPT_ENTRIES = 500
"""Entries of the event log that are kept."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What the loop shows the world: a state, and the last mailbox ticket that is in it."""

    state: State
    ticket: int


class StatePublisher:
    """One thread pins up, any look."""

    def __init__(self, first: Snapshot, loop_timing: LoopTiming) -> None:
        self._snapshot = first
        self._event_log: deque[LogEntry] = deque(maxlen=MAX_KEPT_ENTRIES)
        self._pinned = threading.Condition()
        self._untold: deque[TicketOutcome] = deque(maxlen=MAX_KEPT_ENTRIES)
        self.outcomes = Outcomes()
        """What became of commands, by their tickets."""
        self.loop_timing = loop_timing
        """How well the loop keeps its period."""

    @property
    def snapshot(self) -> Snapshot:
        """The newest one."""
        return self._snapshot

    @property
    def event_log(self) -> tuple[LogEntry, ...]:
        """The last reasons why the arm did not do what was wished, oldest first."""
        return tuple(self._event_log)

    def pin(self, snapshot: Snapshot, news: Sequence[LogEntry] = ()) -> None:
        """Show ``snapshot`` from now on, and ``news`` in the event log."""
        with self._pinned:
            self._event_log.extend(news)
            self._snapshot = snapshot
            self._pinned.notify_all()

    def note(self, told: Iterable[TicketOutcome]) -> None:
        """Record what became of commands; to be called before ``pin``."""
        told = tuple(told)
        self.outcomes.note(told)
        with self._pinned:
            self._untold.extend(told)

    def take_outcomes(self) -> tuple[TicketOutcome, ...]:
        """Hand out the outcomes that were noted since this was last called."""
        with self._pinned:
            told = tuple(self._untold)
            self._untold.clear()
            return told

    def wait_for_change(self, seen: Snapshot, timeout: float) -> Snapshot:
        """The newest snapshot, as soon as it is another than ``seen`` or ``timeout`` [s] is up."""
        with self._pinned:
            self._pinned.wait_for(lambda: self._snapshot is not seen, timeout)
            return self._snapshot

    def wait_for_command(self, seen: Snapshot, timeout: float) -> None:
        """Return as soon as a command newer than ``seen`` is in, or ``timeout`` [s] is up."""
        with self._pinned:
            self._pinned.wait_for(lambda: self._snapshot.ticket != seen.ticket, timeout)
