"""Muted identities: how often their STOPs and requests count.

A muted person keeps STOP. One press takes effect per interval; a press while the arm is stopped
anyway changes nothing and uses up nothing. See docs/decisions/0061.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from katana450.errors import LeaseError

STOP_INTERVAL, MIN_INTERVAL, MAX_INTERVAL = 10.0, 1.0, 60.0
"""Default, minimum and maximum interval [s] between two STOPs or requests of a muted identity."""


class MutedError(LeaseError):
    """Raised for a STOP or a request of a muted identity that does not count.

    Attributes:
        retry: Time [s] after which the next one counts.
    """

    def __init__(self, what: str, retry: float) -> None:
        self.retry = math.ceil(10.0 * retry) / 10.0
        super().__init__(
            f"An admin has muted you: this {what} does not count. "
            f"Your next one counts in {self.retry:.1f} s."
        )


@dataclass
class _Mute:
    """The mute of one identity. ``due``: times [s] from which the next STOP or request counts."""

    interval: float
    due: dict[str, float] = field(default_factory=dict)


class Mutes:
    """The muted identities, by session. Times are in seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._mutes: dict[str, _Mute] = {}

    def add(self, session: str, interval: float = STOP_INTERVAL) -> None:
        """Mute ``session``: one STOP and one request count per ``interval`` [s] from now on."""
        known = self._mutes.setdefault(session, _Mute(interval))
        known.interval = interval

    def remove(self, session: str) -> None:
        """End the mute of ``session``, if it is muted."""
        self._mutes.pop(session, None)

    def interval(self, session: str) -> float | None:
        """Return the interval of ``session`` [s]; None unless it is muted."""
        known = self._mutes.get(session)
        return None if known is None else known.interval

    @property
    def sessions(self) -> tuple[str, ...]:
        """All muted sessions."""
        return tuple(self._mutes)

    def count_stop(self, session: str) -> None:
        """Count a STOP of ``session``. Raises MutedError if it does not count."""
        self._count(session, "STOP")

    def count_request(self, session: str) -> None:
        """Count a request of ``session``. Raises MutedError if it does not count."""
        self._count(session, "request")

    def _count(self, session: str, what: str) -> None:
        known, t = self._mutes.get(session), self._clock()
        if known is None:
            return
        wait = known.due.get(what, -math.inf) - t
        if wait > 0.0:
            raise MutedError(what, wait)
        known.due[what] = t + known.interval
