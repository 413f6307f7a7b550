"""The clock of the control loop, in place of which a test has one that is set."""

from __future__ import annotations

import sys
import time
from threading import Event


class MonotonicClock:
    """The monotonic clock of the machine."""

    def now(self) -> float:
        """Return the time since a fixed moment [s]."""
        return time.perf_counter()

    def sleep_until(self, t: float, wake: Event | None = None) -> None:
        """Return at ``t`` [s], or at once if that has passed, or as soon as ``wake`` is set.

        Windows ignores ``wake``: there only a plain sleep is exact to a millisecond.
        """
        left = t - time.perf_counter()
        if left <= 0.0:
            return
        if wake is None or sys.platform == "win32":
            time.sleep(left)
        else:
            wake.wait(left)
