"""Record of the outcomes of commands by their tickets, for threads that wait for them."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress

from katana450.arm.control.state.state import Outcome

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
