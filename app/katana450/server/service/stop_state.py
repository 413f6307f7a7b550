"""Why nothing moves, and whether the arm has confirmed it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.runtime.state_publisher import Snapshot

REMEMBERED = 256
"""Presses of STOP that are known when they are repeated."""


@dataclass(frozen=True)
class StopRecord:
    """Why nothing moves.

    Attributes:
        by: name of the participant who pressed STOP; None when the gateway itself stopped the arm.
        why: the reason in words.
        ticket: of the newest stop that was sent to the arm; None before one was sent.
        confirmed: whether a state of the arm, newer than the request, is stopped.
    """

    by: str | None
    why: str
    ticket: int | None = None
    confirmed: bool = False

    @property
    def stage(self) -> str:
        """``requested``, or ``confirmed`` once the arm has shown that it is stopped."""
        return "confirmed" if self.confirmed else "requested"

    def requested(self, ticket: int) -> Self:
        """The stop was sent (again) as ``ticket`` and is not confirmed yet."""
        return replace(self, ticket=ticket, confirmed=False)

    def seen(self, snapshot: Snapshot) -> Self:
        """Confirmed, once ``snapshot`` has the request in it and is stopped; else as it was."""
        if self.confirmed or self.ticket is None or snapshot.ticket < self.ticket:
            return self
        return self if snapshot.state.stopped is None else replace(self, confirmed=True)


class Presses:
    """Presses of STOP that were counted."""

    def __init__(self) -> None:
        self._counted: deque[str] = deque(maxlen=REMEMBERED)

    def is_new(self, press: str | None) -> bool:
        """Count ``press``; whether it was not counted before. Without a name each is new."""
        if press is None:
            return True
        if press in self._counted:
            return False
        self._counted.append(press)
        return True
