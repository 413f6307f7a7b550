"""The buffer of polynomials of one axis, and the setpoint that they make."""

from __future__ import annotations

from collections import deque

from katana450.extensions.real_arm.codec.requests import AxisSegment, More

DEPTH = 16
"""Polynomials that fit. Reported by people who drove real arms, as a guess."""

TICK = 0.01
"""[s] Unit of time of the polynomials."""


class SplineBuffer:
    """The waiting polynomials of an axis, and the one that is executed.

    A polynomial stays in the buffer until it ends. When the next one is late, the setpoint waits at
    the end of the last.

    Attributes:
        position: the setpoint [counts].
        speed: its speed [counts/s].
    """

    def __init__(self) -> None:
        self.position = 0.0
        self.speed = 0.0
        self._waiting: deque[tuple[AxisSegment, bool]] = deque()
        self._tick = 0.0
        self._is_last = False
        self.is_running = False

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def is_full(self) -> bool:
        """True if no further polynomial fits."""
        return len(self._waiting) >= DEPTH

    def store(self, segment: AxisSegment, more: int) -> None:
        """Append ``segment``. The caller has checked ``is_full``."""
        self._waiting.append((segment, more == More.LAST))

    def start(self, more: int) -> None:
        """Execute what is stored. The newest polynomial is the end of the motion for LAST."""
        if more == More.LAST and self._waiting:
            self._waiting[-1] = (self._waiting[-1][0], True)
        if not self.is_running and self._waiting:
            self.is_running, self._is_last, self._tick = True, False, 0.0
            self.position = float(self._waiting[0][0].p0)

    def flush(self) -> None:
        """Drop all polynomials but the one that is executed, which ends the motion then."""
        kept = self._waiting[0][0] if self.is_running and self._waiting else None
        self._waiting.clear()
        if kept is not None:
            self._waiting.append((kept, True))
        self._is_last = True

    def clear(self) -> None:
        """Drop everything and end the motion."""
        self._waiting.clear()
        self.is_running = False
        self.speed = 0.0

    def advance(self, dt: float) -> None:
        """Move the setpoint for ``dt`` [s]; ``is_running`` is False after the end."""
        self._tick += dt / TICK
        while self._waiting:
            segment, is_last = self._waiting[0]
            if self._tick < segment.ticks:
                self.position = segment.at(self._tick)
                self.speed = segment.speed_at(self._tick) / TICK
                return
            self._waiting.popleft()
            self._tick -= max(segment.ticks, 0)
            self.position, self.speed = float(segment.target), 0.0
            self._is_last = is_last
        self._tick = 0.0
        self.is_running = self.is_running and not self._is_last
