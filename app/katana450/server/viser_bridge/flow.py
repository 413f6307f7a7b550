"""Flow control: how far a browser is behind, and how much more may be sent to it.

The page reports the number of frames on its screen. The bytes that were sent and not yet seen are
limited to the amount that the connection recently carried in time. At the limit no frame is taken
from viser, which meanwhile replaces its waiting messages by newer ones. A slow connection therefore
shows fewer frames instead of old ones.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

OVERDUE = 0.3
"""Time [s] from sending to display, beyond the minimum delay, above which a frame is late."""

FORGET = 0.005
"""Maximum growth [s/s] of the estimated minimum delay."""

MIN_IN_FLIGHT_BYTES, FIRST_IN_FLIGHT_BYTES, MAX_IN_FLIGHT_BYTES = 2_048, 8_192, 262_144
"""Minimum, initial and maximum limit of bytes in flight.

The limit grows while all frames are in time, and halves when one is late.
"""

MAX_LINE_DELAY = 1.0
"""Maximum of the estimated minimum delay [s]."""

MAX_REMEMBERED_FRAMES = 4096
"""Maximum number of remembered frames: one minute, for a browser that never reports any."""


class _Sent(NamedTuple):
    t: float
    size: int


class FlowControl:
    """The frames in flight to one browser. All times are arguments [s].

    Attributes:
        counts: whether the browser reports the frames on its screen. Our page does, other programs
            do not.
    """

    def __init__(self) -> None:
        self._in_flight: deque[_Sent] = deque(maxlen=MAX_REMEMBERED_FRAMES)
        self._bytes = 0
        self._window = FIRST_IN_FLIGHT_BYTES
        self._min_delay: float | None = None
        self._reported_at = 0.0
        self._sent = 0
        self.counts = False

    def sent(self, size: int, t: float) -> None:
        """Note that a frame of ``size`` bytes was sent at ``t``."""
        self._sent += 1
        self._in_flight.append(_Sent(t, size))
        self._bytes += size

    def seen(self, count: int, t: float) -> bool:
        """Note that ``count`` frames are on the screen at ``t``; return False if impossible."""
        missing = self._sent - count
        if not 0 <= missing <= len(self._in_flight):
            return False
        frames = [self._in_flight.popleft() for _ in range(len(self._in_flight) - missing)]
        if not self.counts:
            # The first frames contain the whole scene, so their delay says little about later ones.
            self.counts = True
            self._bytes = sum(frame.size for frame in self._in_flight)
        elif frames:
            size = sum(frame.size for frame in frames)
            filled = 2 * self._bytes >= self._window
            self._bytes -= size
            delay = t - frames[-1].t
            known = (
                delay
                if self._min_delay is None
                else self._min_delay + FORGET * (t - self._reported_at)
            )
            self._min_delay = min(known, delay, MAX_LINE_DELAY)
            self._reported_at = t
            if t - frames[0].t > self._min_delay + OVERDUE:
                self._window = max(self._window // 2, MIN_IN_FLIGHT_BYTES)
            elif filled:
                # A window that was never filled is untested. If the connection became slow, all of
                # it would be in flight at once (RFC 7661, congestion window validation).
                self._window = min(self._window + size // 2, MAX_IN_FLIGHT_BYTES)
        return True

    def age(self, t: float) -> float:
        """Return the age [s] at ``t`` of the oldest frame in flight; 0 if there is none."""
        if not (self.counts and self._in_flight):
            return 0.0
        return t - self._in_flight[0].t

    def has_room(self, t: float) -> bool:
        """Return whether another frame may be sent at ``t``."""
        if not (self.counts and self._in_flight):
            return True
        in_time = t - self._in_flight[0].t < OVERDUE + (self._min_delay or 0.0)
        return in_time and self._bytes < self._window
