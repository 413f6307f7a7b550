"""Publication of the states of the control loop to other threads and to the pipe."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from katana450.arm.control.state.state import State
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.outcomes import MAX_KEPT_OUTCOMES, Outcomes, TicketOutcome


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A state, and the ticket of the last command that it includes."""

    state: State
    ticket: int

    def __post_init__(self) -> None:
        """Complete the state before another thread sees it."""
        _ = self.state.moving, self.state.under_way


class StatePublisher:
    """The newest snapshot and outcomes. One thread publishes, any thread reads."""

    def __init__(self, first: Snapshot, loop_timing: LoopTiming) -> None:
        self._snapshot = first
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

    def publish(self, snapshot: Snapshot) -> None:
        """Publish ``snapshot``."""
        with self._published:
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
