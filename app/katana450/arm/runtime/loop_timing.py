"""How well the control loop keeps its period."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

TIMED_TICKS = 1000
"""Ticks: the last ten seconds of a loop at 100 Hz."""


@dataclass(frozen=True)
class LoopTiming:
    """How much later than due the ticks came.

    Attributes:
        period: of the loop [s].
        count: ticks that are looked at.
        p50, p99, most: [s] of these; a tick is never early.
        lost: ticks that came more than a whole period late, since the start.
    """

    period: float
    count: int = 0
    p50: float = 0.0
    p99: float = 0.0
    maximum: float = 0.0
    lost: int = 0


class Punctuality:
    """Takes down when ticks come; one thread notes, any reads."""

    def __init__(self, period: float) -> None:
        """``period``: of the loop [s]."""
        self._period = period
        self._late: deque[float] = deque(maxlen=TIMED_TICKS)
        self._lost = 0

    def note(self, late: float) -> None:
        """A tick came ``late`` [s] after it was due."""
        self._late.append(max(late, 0.0))
        self._lost += late > self._period

    @property
    def loop_timing(self) -> LoopTiming:
        """Of the last ticks."""
        late = np.array(self._late.copy())
        if late.size == 0:
            return LoopTiming(self._period)
        p50, p99 = np.quantile(late, (0.5, 0.99)).tolist()
        maximum = float(late.max())
        return LoopTiming(self._period, late.size, p50, p99, maximum, self._lost)
