"""Publication of the states of the control loop, its timing, and the outcomes of commands."""

from __future__ import annotations

import threading
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.state.state import Outcome, State

TIMED_TICKS = 1000
"""Number of ticks that are measured: the last ten seconds of a loop at 100 Hz."""


@dataclass(frozen=True)
class LoopTiming:
    """Lateness of the ticks of a loop.

    Attributes:
        period: period of the loop [s].
        ticks: number of ticks that are measured.
        late_p50, late_p99, late_max: quantiles and maximum of their lateness [s]; a tick is never
            early.
        lost: number of ticks since the start that were more than a whole period late.
    """

    period: float
    ticks: int = 0
    late_p50: float = 0.0
    late_p99: float = 0.0
    late_max: float = 0.0
    lost: int = 0


class Punctuality:
    """Record of the lateness of ticks. One thread notes, any thread reads."""

    def __init__(self, period: float) -> None:
        """Create an empty record for a loop of ``period`` [s]."""
        self._period = period
        self._late: deque[float] = deque(maxlen=TIMED_TICKS)
        self._lost = 0

    def note(self, late: float) -> None:
        """Record a tick that came ``late`` [s] after it was due."""
        self._late.append(max(late, 0.0))
        self._lost += late > self._period

    @property
    def loop_timing(self) -> LoopTiming:
        """Timing of the last ticks."""
        late = np.array(self._late.copy())
        if late.size == 0:
            return LoopTiming(self._period)
        p50, p99 = np.quantile(late, (0.5, 0.99)).tolist()
        return LoopTiming(self._period, late.size, p50, p99, float(late.max()), self._lost)


MAX_KEPT_OUTCOMES = 1024
"""Maximum number of recorded outcomes, and of awaited tickets: many seconds of a fast stream."""

TicketOutcome = tuple[int, Outcome]
"""A ticket and the outcome of its command."""


class Outcomes:
    """The newest outcomes. Safe for use by any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[int, Outcome] = OrderedDict()
        self._awaited: OrderedDict[int, list[Future[Outcome]]] = OrderedDict()

    def note(self, outcomes: Iterable[TicketOutcome]) -> None:
        """Record ``outcomes``, and wake the threads that wait for them."""
        ready: list[tuple[Future[Outcome], Outcome]] = []
        with self._lock:
            for ticket, outcome in outcomes:
                self._known[ticket] = outcome
                ready += [(future, outcome) for future in self._awaited.pop(ticket, ())]
            while len(self._known) > MAX_KEPT_OUTCOMES:
                self._known.popitem(last=False)
        for future, outcome in ready:
            # A future that was cancelled meanwhile takes no result.
            with suppress(InvalidStateError):
                future.set_result(outcome)

    def of(self, ticket: int) -> Future[Outcome]:
        """Return a future of the outcome of ``ticket``; each caller may cancel its own."""
        future: Future[Outcome] = Future()
        with self._lock:
            known = self._known.get(ticket)
            if known is None:
                self._awaited.setdefault(ticket, []).append(future)
                while len(self._awaited) > MAX_KEPT_OUTCOMES:
                    self._awaited.popitem(last=False)
        if known is not None:
            future.set_result(known)
        return future


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
