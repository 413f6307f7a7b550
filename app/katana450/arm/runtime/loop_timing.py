"""Timing of the control loop: the lateness of its ticks."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

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
