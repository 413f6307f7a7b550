"""Rate limits with bursts, of one sender or of each, and limits of what is open at once."""

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


class SenderBuckets:
    """A bucket for each sender, filled at its first event, and one for all together."""

    def __init__(
        self, rate: float, size: float, maximum: int, total: TokenBucket | None = None
    ) -> None:
        """Create no bucket yet; ``rate`` and ``size`` are those of each.

        ``maximum``: number of buckets that are kept; a new one replaces the oldest. ``total``: the
        bucket for all senders together; None for none.
        """
        self._rate, self._size, self._maximum, self._total = rate, size, maximum, total
        self._buckets: dict[str, TokenBucket] = {}

    def take(self, sender: str, t: float) -> bool:
        """Take a token of ``sender`` at time ``t`` [s]; return False if none is left."""
        bucket = self._buckets.pop(sender, None) or TokenBucket(self._rate, self._size, t)
        self._buckets[sender] = bucket
        if len(self._buckets) > self._maximum:
            del self._buckets[next(iter(self._buckets))]
        return bucket.take(t) and (self._total is None or self._total.take(t))

    def __len__(self) -> int:
        """Return the number of buckets."""
        return len(self._buckets)


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
