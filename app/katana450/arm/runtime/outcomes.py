"""Record of what became of commands, by their tickets, for whoever waits for it."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress

from katana450.arm.control.state import Outcome

MAX_KEPT_OUTCOMES = 1024
"""Outcomes that are remembered, and tickets that are waited for: many seconds of a quick stream."""

TicketOutcome = tuple[int, Outcome]
"""A ticket and what became of its command."""


class Outcomes:
    """The newest outcomes. Safe for every thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[int, Outcome] = OrderedDict()
        self._awaited: OrderedDict[int, Future[Outcome]] = OrderedDict()

    def note(self, told: Iterable[TicketOutcome]) -> None:
        """Record ``told`` and wake whoever waits for it."""
        ready = []
        with self._lock:
            for ticket, outcome in told:
                self._known[ticket] = outcome
                if ticket in self._awaited:
                    ready.append((self._awaited.pop(ticket), outcome))
            while len(self._known) > MAX_KEPT_OUTCOMES:
                self._known.popitem(last=False)
        for future, outcome in ready:
            # Cancelled meanwhile: nobody waits any more.
            with suppress(InvalidStateError):
                future.set_result(outcome)

    def of(self, ticket: int) -> Future[Outcome]:
        """Return the outcome of ``ticket``, once it is recorded. For one that waits."""
        future: Future[Outcome] = Future()
        with self._lock:
            known = self._known.get(ticket)
            if known is None:
                self._awaited[ticket] = future
                while len(self._awaited) > MAX_KEPT_OUTCOMES:
                    self._awaited.popitem(last=False)
        if known is not None:
            future.set_result(known)
        return future
