"""How often something may happen."""

from __future__ import annotations


class TokenBucket:
    """Tokens that come back with time; an event takes some, or is refused when they are gone."""

    def __init__(self, rate: float, size: float, t: float) -> None:
        """``rate``: tokens that come back a second. ``size``: how many there are at most."""
        self._rate = rate
        self._size = size
        self._left = size
        self._t = t

    def take(self, t: float, tokens: float = 1.0) -> bool:
        """Whether there were that many at time ``t`` [s]; they are gone then, else they stay."""
        self._left = min(self._size, self._left + self._rate * max(t - self._t, 0.0))
        self._t = max(t, self._t)
        if tokens > self._left:
            return False
        self._left -= tokens
        return True
