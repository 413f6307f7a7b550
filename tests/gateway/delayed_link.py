"""A connection that delays all data and loses none, as a bad wireless network does."""

from __future__ import annotations

import asyncio
import math
import random

from tests.gateway.slow_link import WINDOW, SlowLink


class DelayedLink(SlowLink):
    """Context manager that relays connections from ``port`` to ``to_port`` on this machine.

    ``delay`` [s] holds in each direction for all data that comes from now on, and so does
    ``jitter`` [s], the maximum of a random delay that is added. Data keeps its order.
    """

    def __init__(self, to_port: int, delay: float = 0.0, jitter: float = 0.0) -> None:
        super().__init__(to_port, math.inf, delay)
        self.jitter = jitter
        self._random = random.Random(450)

    async def _carry(
        self, source: asyncio.StreamReader, to: asyncio.StreamWriter, _way: int
    ) -> None:
        due = 0.0
        while data := await source.read(WINDOW):
            delay = self.delay + self._random.uniform(0.0, self.jitter)
            due = max(due, self._loop.time() + delay)
            self._loop.call_at(due, _write, to, data)


def _write(to: asyncio.StreamWriter, data: bytes) -> None:
    # The other side may have left meanwhile.
    if not to.is_closing():
        to.write(data)
