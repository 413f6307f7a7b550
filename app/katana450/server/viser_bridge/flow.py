"""How far a browser is behind, and how much more may be sent to it.

The page says how many frames it has put on its screen. What was sent and not yet seen is bounded,
in bytes, to what the line has lately carried in time; while it is full nothing more is taken from
viser, which meanwhile replaces what it holds by what is newer. So a thin line shows few pictures
instead of old ones.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

OVERDUE = 0.3
"""[s] From sending to seeing, beyond what the line needs at its best."""

FORGET = 0.005
"""[s/s] What a line needs at its best may grow so fast."""

MIN_IN_FLIGHT_BYTES, FIRST_IN_FLIGHT_BYTES, MAX_IN_FLIGHT_BYTES = 2_048, 8_192, 262_144
"""Bytes that may be on the way: at least, at first, at most. More while all is seen in time, half
as many when not."""

MAX_LINE_DELAY = 1.0
"""[s] What a line may need at its best and still be waited for."""

MAX_REMEMBERED_FRAMES = 4096
"""Frames that are kept in mind: a minute of them, for a browser that never says what it sees."""


class _Sent(NamedTuple):
    t: float
    size: int


class FlowControl:
    """The frames on their way to one browser. Times are arguments, in seconds."""

    def __init__(self) -> None:
        self._on_the_way: deque[_Sent] = deque(maxlen=MAX_REMEMBERED_FRAMES)
        self._bytes = 0
        self._window = FIRST_IN_FLIGHT_BYTES
        self._quickest: float | None = None
        self._told_at = 0.0
        self._sent = 0
        self.counts = False
        """Whether the browser says what it has seen: our page does, other programs do not."""

    def sent(self, size: int, t: float) -> None:
        """One more frame of ``size`` bytes was sent at ``t``."""
        self._sent += 1
        self._on_the_way.append(_Sent(t, size))
        self._bytes += size

    def seen(self, count: int, t: float) -> bool:
        """``count`` frames are on the screen at ``t``; whether that can be true."""
        missing = self._sent - count
        if not 0 <= missing <= len(self._on_the_way):
            return False
        seen = [self._on_the_way.popleft() for _ in range(len(self._on_the_way) - missing)]
        if not self.counts:
            # The scene itself: how long that takes says little of what follows.
            self.counts = True
            self._bytes = sum(each.size for each in self._on_the_way)
        elif seen:
            size = sum(each.size for each in seen)
            filled = 2 * self._bytes >= self._window
            self._bytes -= size
            took = t - seen[-1].t
            known = (
                took if self._quickest is None else self._quickest + FORGET * (t - self._told_at)
            )
            self._quickest = min(known, took, MAX_LINE_DELAY)
            self._told_at = t
            if t - seen[0].t > self._quickest + OVERDUE:
                self._window = max(self._window // 2, MIN_IN_FLIGHT_BYTES)
            elif filled:
                # A window that was never filled has not been tried: should the line grow thin, all
                # of it would be on the way at once (RFC 7661, congestion window validation).
                self._window = min(self._window + size // 2, MAX_IN_FLIGHT_BYTES)
        return True

    def age(self, t: float) -> float:
        """How old the oldest frame is that was sent and is not on the screen; 0 without."""
        if not (self.counts and self._on_the_way):
            return 0.0
        return t - self._on_the_way[0].t

    def has_room(self, t: float) -> bool:
        """Whether another frame may be sent."""
        if not (self.counts and self._on_the_way):
            return True
        in_time = t - self._on_the_way[0].t < OVERDUE + (self._quickest or 0.0)
        return in_time and self._bytes < self._window
