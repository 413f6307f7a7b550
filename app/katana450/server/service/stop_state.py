"""Reason of a stop, and whether the arm has confirmed it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.runtime.state_publisher import Snapshot

REMEMBERED = 256
"""Number of presses of STOP whose repetitions are recognised."""


@dataclass(frozen=True)
class StopRecord:
    """A stop and its reason.

    Attributes:
        by: Name of the participant that pressed STOP; None when the gateway itself stopped the arm.
        why: Reason in words.
        ticket: Ticket of the newest stop sent to the arm; None before one was sent.
        confirmed: Whether a state of the arm that is newer than the request is stopped.
    """

    by: str | None
    why: str
    ticket: int | None = None
    confirmed: bool = False

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


class Presses:
    """Recent presses of STOP, each of which counts once."""

    def __init__(self) -> None:
        self._counted: deque[str] = deque(maxlen=REMEMBERED)

    def is_known(self, press: str | None) -> bool:
        """Return whether ``press`` was counted. A press without a name is always new."""
        return press is not None and press in self._counted

    def count(self, press: str | None) -> None:
        """Count ``press``."""
        if press is not None:
            self._counted.append(press)
