"""Delay of messages beyond the least delay of their connection.

Each message carries the time of its making on the sender's own clock. The difference between the
two clocks is part of every delay, so only the excess over the least delay says how late a message
is. A delay that was always there looks like a difference between the clocks.
"""

from __future__ import annotations

import math

from katana450.errors import LeaseError

WINDOW = 10.0
"""[s] Time after which a longer delay counts as usual, as after a change of the route or a drift of
the clocks."""

MIN_MESSAGES = 10
"""Minimum number of messages in that time, so that a single late one does not count as usual."""


class LeastDelay:
    """The least recent delay of one connection. All times are arguments [s]."""

    def __init__(self) -> None:
        self._least = self._candidate = math.inf
        self._restart(-math.inf)

    def excess(self, made: float, t: float, limit: float = math.inf) -> float:
        """Return how much longer than the least a message took that was made at ``made``.

        ``made`` is on the clock of the sender and ``t``, the present, on that of the receiver.
        ``limit``: excess [s] above which the message is not executed. While such messages come,
        their delay never counts as usual: a person who holds a key must let go first.
        """
        delay = t - made
        self._candidate = min(self._candidate, delay)
        self._least = min(self._least, delay)
        self._messages += 1
        if t - self._since >= WINDOW and self._messages >= MIN_MESSAGES:
            self._least = self._candidate
            self._restart(t)
        excess = delay - self._least
        if excess > limit:
            self._restart(t)
        return excess

    def _restart(self, t: float) -> None:
        """Begin another search for the least delay at ``t``."""
        self._candidate, self._since, self._messages = math.inf, t, 0


def check_in_time(delay: float, limit: float) -> None:
    """Raise LeaseError for a sample with a ``delay`` above ``limit`` [s]."""
    if delay > limit:
        raise LeaseError(
            f"Not executed, because it arrived {delay:.1f} s late: the arm would still move after "
            "you let go. Let go, and drive again once the connection is as fast as before, or "
            f"after {WINDOW:g} s at its present speed."
        )
