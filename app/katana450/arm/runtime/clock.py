"""Clocks for the control loop, which runs on another clock in a test."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock."""

    def now(self) -> float:
        """Return the time since a fixed moment [s]."""
        ...

    def sleep_until(self, t: float) -> None:
        """Return at ``t`` [s], or at once if that has passed."""
        ...


class MonotonicClock:
    """The monotonic clock of the machine."""

    def now(self) -> float:
        """Return the time since a fixed moment [s]."""
        return time.perf_counter()

    def sleep_until(self, t: float) -> None:
        """Return at ``t`` [s], or at once if that has passed."""
        left = t - time.perf_counter()
        if left > 0.0:
            time.sleep(left)
