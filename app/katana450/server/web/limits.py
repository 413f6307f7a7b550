"""Token bucket: a rate limit with bursts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


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


class ConnectionLimit:
    """Places for concurrent connections or requests."""

    def __init__(self, maximum: int, own_maximum: int) -> None:
        """Provide ``maximum`` places in total, and at most ``own_maximum`` for one identity."""
        self._maximum = maximum
        self._own_maximum = own_maximum
        self._taken: Counter[str] = Counter()

    @contextmanager
    def taken(self, identity: str, reserved: int = 0) -> Iterator[bool]:
        """Take a place inside the ``with`` block; yield False if there is none left.

        ``reserved``: number of places that ``identity`` has even if all others are taken.
        """
        own = self._taken[identity]
        free = own < reserved or (own < self._own_maximum and self._taken.total() < self._maximum)
        if not free:
            yield False
            return
        self._taken[identity] += 1
        try:
            yield True
        finally:
            self._taken[identity] -= 1
            if not self._taken[identity]:
                del self._taken[identity]
