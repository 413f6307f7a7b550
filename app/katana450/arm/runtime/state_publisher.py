"""Publication of the states of the control loop to other threads and to the pipe."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.state import State
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.outcomes import MAX_KEPT_OUTCOMES, Outcomes, TicketOutcome

MAX_KEPT_ENTRIES = 500
"""Maximum number of entries of the event log."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A state, and the ticket of the last command that it includes."""

    state: State
    ticket: int

    def __post_init__(self) -> None:
        """Complete the state before another thread sees it."""
        _ = self.state.moving, self.state.under_way


class StatePublisher:
    """The newest snapshot, the event log and outcomes. One thread publishes, any thread reads."""

    def __init__(self, first: Snapshot, loop_timing: LoopTiming) -> None:
        self._snapshot = first
        self._event_log: deque[LogEntry] = deque(maxlen=MAX_KEPT_ENTRIES)
        self._published = threading.Condition()
        self._unsent: deque[TicketOutcome] = deque(maxlen=MAX_KEPT_OUTCOMES)
        self.outcomes = Outcomes()
        """Outcomes of commands, by their tickets."""
        self.loop_timing = loop_timing
        """Timing of the control loop."""

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot."""
        return self._snapshot

    @property
    def event_log(self) -> tuple[LogEntry, ...]:
        """The last entries of the event log, oldest first."""
        with self._published:
            return tuple(self._event_log)

    def publish(self, snapshot: Snapshot, entries: Sequence[LogEntry] = ()) -> None:
        """Publish ``snapshot``, and add ``entries`` to the event log."""
        with self._published:
            self._event_log.extend(entries)
            self._snapshot = snapshot
            self._published.notify_all()

    def note(self, outcomes: Iterable[TicketOutcome]) -> None:
        """Record outcomes of commands; to be called before ``publish``."""
        outcomes = tuple(outcomes)
        self.outcomes.note(outcomes)
        with self._published:
            self._unsent.extend(outcomes)

    def take_outcomes(self) -> tuple[TicketOutcome, ...]:
        """Return the outcomes noted since the last call, at most the last MAX_KEPT_OUTCOMES."""
        with self._published:
            outcomes = tuple(self._unsent)
            self._unsent.clear()
            return outcomes

    def wait_for_change(
        self, last: Snapshot, timeout: float, ended: Callable[[], bool] = lambda: False
    ) -> Snapshot:
        """Return the newest snapshot once it is another than ``last``, or after ``timeout`` [s].

        ``ended``: whether the thread that waits is to end. Call ``wake`` when that changes.
        """
        with self._published:
            self._published.wait_for(lambda: self._snapshot is not last or ended(), timeout)
            return self._snapshot

    def wake(self) -> None:
        """Let each thread that waits for a change check whether it is to end."""
        with self._published:
            self._published.notify_all()

    def wait_for_command(self, last: Snapshot, timeout: float) -> None:
        """Return once a command newer than ``last`` is published, or after ``timeout`` [s]."""
        with self._published:
            self._published.wait_for(lambda: self._snapshot.ticket != last.ticket, timeout)
