"""Rate limits with bursts, of one sender or of each, and limits of what is open at once."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from katana450.errors import InputError

T = TypeVar("T")


class TokenBucket:
    """Tokens that refill with time. An event takes tokens, and is refused if too few are left."""

    def __init__(self, rate: float, size: float, t: float, debt: float = 0.0) -> None:
        """Fill the bucket at time ``t`` [s].

        ``rate``: refill per second. ``size``: maximum. ``debt``: maximum of the tokens that are
        spent beyond those that there are.
        """
        self._rate, self._size, self._debt = rate, size, debt
        self._left = size
        self._t = t

    def left(self, t: float) -> float:
        """Return the number of tokens at time ``t`` [s]; negative for a debt."""
        self._left = min(self._size, self._left + self._rate * max(t - self._t, 0.0))
        self._t = max(t, self._t)
        return self._left

    def take(self, t: float, tokens: float = 1.0) -> bool:
        """Take ``tokens`` at time ``t`` [s] and return True; take none if too few are left."""
        if tokens > self.left(t):
            return False
        self._left -= tokens
        return True

    def spend(self, tokens: float) -> None:
        """Take ``tokens``, whose number is known only now, also beyond those that are left."""
        self._left = max(self._left - tokens, -self._debt)

    def wait(self, t: float) -> float:
        """Return the time [s] from ``t`` [s] until there is no debt; 0 without one."""
        return max(-self.left(t), 0.0) / self._rate


class SenderBuckets:
    """A bucket for each sender, filled at its first event, and one for all together."""

    def __init__(
        self,
        rate: float,
        size: float,
        maximum: int,
        total: TokenBucket | None = None,
        debt: float = 0.0,
    ) -> None:
        """Create no bucket yet; ``rate``, ``size`` and ``debt`` are those of each.

        ``maximum``: number of buckets that are kept; a new one replaces the oldest. ``total``: the
        bucket for all senders together; None for none.
        """
        self._rate, self._size, self._debt = rate, size, debt
        self._maximum, self._total = maximum, total
        self._buckets: dict[str, TokenBucket] = {}

    def bucket_of(self, sender: str, t: float) -> TokenBucket:
        """Return the bucket of ``sender``, which is filled at time ``t`` [s] if it is new."""
        bucket = self._buckets.pop(sender, None)
        if bucket is None:
            bucket = TokenBucket(self._rate, self._size, t, self._debt)
        self._buckets[sender] = bucket
        if len(self._buckets) > self._maximum:
            del self._buckets[next(iter(self._buckets))]
        return bucket

    def take(self, sender: str, t: float) -> bool:
        """Take a token of ``sender`` at time ``t`` [s]; return False if none is left."""
        own = self.bucket_of(sender, t).take(t)
        return own and (self._total is None or self._total.take(t))

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


class CrowdedError(InputError):
    """Raised for work that is refused because too much of it waits."""


class BoundedWork:
    """Work in threads: some of it at the same time, while more waits, and the rest is refused."""

    def __init__(self, at_once: int, maximum: int, refusal: str) -> None:
        """Do ``at_once`` of at most ``maximum``. ``refusal``: what to say beyond it."""
        self._working = asyncio.Semaphore(at_once)
        self._maximum, self._refusal = maximum, refusal
        self._count = 0

    async def result(self, act: Callable[[], T]) -> T:
        """Return the result of ``act``. Raises its errors, and CrowdedError."""
        if self._count >= self._maximum:
            raise CrowdedError(self._refusal)
        # A thread that nobody waits for any more still counts until it ends.
        return await asyncio.shield(self._done(act))

    async def _done(self, act: Callable[[], T]) -> T:
        self._count += 1
        try:
            async with self._working:
                return await asyncio.to_thread(act)
        finally:
            self._count -= 1
