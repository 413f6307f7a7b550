"""Cause of the present stop, and news of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.control.state.stop_cause import StopCause
from katana450.arm.runtime.pipes.state_publisher import Snapshot


@dataclass(frozen=True)
class StopRecord:
    """A stop and its cause.

    Attributes:
        cause: Cause of the stop, with the participant that pressed STOP.
        ticket: Ticket of the newest stop sent to the arm; None before one was sent.
        confirmed: Whether a state of the arm that is newer than the request is stopped.
    """

    cause: StopCause
    ticket: int | None = None
    confirmed: bool = False

    @property
    def why(self) -> str:
        """Reason in words."""
        return self.cause.why

    @property
    def stage(self) -> str:
        """Stage of the stop: ``requested``, then ``confirmed`` by a state of the arm."""
        return "confirmed" if self.confirmed else "requested"

    def requested(self, ticket: int) -> Self:
        """Return the record of the stop sent (again) as ``ticket``, not confirmed yet."""
        return replace(self, ticket=ticket, confirmed=False)

    def seen(self, snapshot: Snapshot) -> Self:
        """Return the record, confirmed if ``snapshot`` includes the request and is stopped."""
        if self.confirmed or self.ticket is None or snapshot.ticket < self.ticket:
            return self
        return self if snapshot.state.stopped is None else replace(self, confirmed=True)


class StopNews:
    """Calls listeners when a stop begins, is confirmed for the first time, or is cleared.

    A repeated press is no news, so that a flood of STOP causes no flood of messages.
    """

    def __init__(self) -> None:
        self.listeners: set[Callable[[], None]] = set()
        """Called without arguments, in the thread of ``note``."""
        self._shown = (False, False)

    def note(self, stopped: StopRecord | None) -> None:
        """Call the listeners if ``stopped``, the present stop, is news."""
        confirmed = stopped is not None and (stopped.confirmed or self._shown[1])
        before, self._shown = self._shown, (stopped is not None, confirmed)
        if self._shown != before:
            for listener in tuple(self.listeners):
                listener()
