"""Limit on concurrent connections, in total and per identity, with places reserved."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


class ConnectionLimit:
    """Places for concurrent connections or requests."""

    def __init__(self, maximum: int, each: int) -> None:
        """Provide ``maximum`` places in total, and at most ``each`` for one identity."""
        self._maximum = maximum
        self._each = each
        self._taken: Counter[str] = Counter()

    @contextmanager
    def taken(self, identity: str, reserved: int = 0) -> Iterator[bool]:
        """Take a place inside the ``with`` block; yield False if there is none left.

        ``reserved``: number of places that ``identity`` has even if all others are taken.
        """
        own = self._taken[identity]
        free = own < reserved or (own < self._each and self._taken.total() < self._maximum)
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
