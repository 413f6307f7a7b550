"""A bounded number of places, of which one identity takes only some."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


class ConnectionLimit:
    """Places that are taken for a while, for example by open sockets."""

    def __init__(self, maximum: int, each: int) -> None:
        """``most``: of everybody together. ``each``: of one identity."""
        self._maximum = maximum
        self._each = each
        self._taken: Counter[str] = Counter()

    @contextmanager
    def taken(self, identity: str) -> Iterator[bool]:
        """Take a place; False if there is none left, and then none is taken."""
        free = self._taken.total() < self._maximum and self._taken[identity] < self._each
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
