"""Time, so that the loop can be run on another clock in a test."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A clock that only goes forwards."""

    def now(self) -> float:
        """Seconds since some fixed moment."""
        ...

    def sleep_until(self, t: float) -> None:
        """Return at ``t`` [s], at once when that has passed."""
        ...


class MonotonicClock:
    """The machine's own."""

    def now(self) -> float:
        return time.perf_counter()

    def sleep_until(self, t: float) -> None:
        left = t - time.perf_counter()
        if left > 0.0:
            time.sleep(left)
