"""A clock that is set instead of waited for, and an event loop on it."""

from __future__ import annotations

import asyncio
import selectors
import threading
from typing import Any

from katana450.arm.runtime.clock import MonotonicClock

PERIOD = 0.01
"""[s] Period of the control loop while the arm moves."""

PLANNERS = ("planning", "planner")
"""Names of threads that plan. They take real time."""


class VirtualClock(MonotonicClock):
    """A clock that is set."""

    def __init__(self) -> None:
        self.t = 1000.0

    def now(self) -> float:
        """Return the time [s]."""
        return self.t

    def sleep_until(self, t: float, wake: threading.Event | None = None) -> None:  # noqa: ARG002
        """Set the clock to ``t`` [s], unless that is past."""
        self.t = max(self.t, t)


class _Selector(selectors.DefaultSelector):
    """Selector that sets the clock to the next moment instead of waiting for it."""

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__()
        self._clock = clock

    def select(self, timeout: float | None = None) -> Any:
        """Return what is ready, or let the time pass."""
        ready = super().select(0)
        if ready or (timeout is not None and timeout <= 0.0):
            return ready
        if any(thread.name in PLANNERS for thread in threading.enumerate()):
            # The time passes, but no faster than such a thread needs.
            self._clock.t += min(timeout or PERIOD, PERIOD)
            return super().select(0.002)
        if timeout is None:
            raise RuntimeError("Nothing can happen any more.")
        self._clock.t += timeout
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """Event loop on such a clock."""

    def __init__(self, clock: VirtualClock) -> None:
        self._virtual = clock
        super().__init__(_Selector(clock))

    def time(self) -> float:
        return self._virtual.t

    def run_in_executor(  # type: ignore[override]
        self, _executor: Any, work: Any, *arguments: Any
    ) -> Any:
        """Call ``work`` at once."""
        future = self.create_future()
        try:
            future.set_result(work(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future
