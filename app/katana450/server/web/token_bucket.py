"""Token bucket: a rate limit with bursts."""

from __future__ import annotations


class TokenBucket:
    """Tokens that refill with time. An event takes tokens, and is refused if too few are left."""

    def __init__(self, rate: float, size: float, t: float) -> None:
        """Fill the bucket at time ``t`` [s]. ``rate``: refill per second. ``size``: maximum."""
        self._rate = rate
        self._size = size
        self._left = size
        self._t = t

    def take(self, t: float, tokens: float = 1.0) -> bool:
        """Take ``tokens`` at time ``t`` [s] and return True; take none if too few are left."""
        self._left = min(self._size, self._left + self._rate * max(t - self._t, 0.0))
        self._t = max(t, self._t)
        if tokens > self._left:
            return False
        self._left -= tokens
        return True
