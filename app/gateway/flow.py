"""How far a browser is behind, and how much more may be sent to it.

The page says how many frames it has put on its screen. What was sent and not yet seen is bounded
by time: while the oldest of it is overdue nothing more is taken from viser, which meanwhile
replaces what it holds by what is newer. So a slow link shows few pictures instead of old ones.
"""

from __future__ import annotations

from collections import deque

OVERDUE = 0.3
"""[s] From sending to seeing; several times what a good link and a slow machine need."""

LONGEST = 4096
"""Frames that are kept in mind: a minute of them, for a browser that never says what it sees."""


class Flow:
    """The frames on their way to one browser. Time is an argument."""

    def __init__(self) -> None:
        self._on_the_way: deque[float] = deque(maxlen=LONGEST)
        self._sent = 0
        self.counts = False
        """Whether the browser says what it has seen: our page does, other programs do not."""

    def sent(self, t: float) -> None:
        """One more frame was sent at ``t`` [s]."""
        self._sent += 1
        self._on_the_way.append(t)

    def seen(self, count: int) -> bool:
        """``count`` frames are on the screen by now; whether that can be true."""
        missing = self._sent - count
        if not 0 <= missing <= len(self._on_the_way):
            return False
        self.counts = True
        while len(self._on_the_way) > missing:
            self._on_the_way.popleft()
        return True

    def age(self, t: float) -> float:
        """How old the oldest frame is that was sent and is not on the screen [s]; 0 without."""
        return t - self._on_the_way[0] if self.counts and self._on_the_way else 0.0

    def has_room(self, t: float) -> bool:
        """Whether another frame may be sent."""
        return self.age(t) < OVERDUE
