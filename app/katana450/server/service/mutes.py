"""Muted identities: how often their STOPs and requests count.

A muted person keeps STOP. One press takes effect per interval; a press while the arm is stopped
anyway changes nothing and uses up nothing. See docs/decisions/0061.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from katana450.arm.control.stop_cause import StopCause
from katana450.errors import LeaseError
from katana450.server.service.participants import session_of

STOP_INTERVAL = 10.0
"""Default interval [s] between two STOPs or requests of a muted identity."""

MAX_COUNTED = 512
"""Maximum number of remembered times at which a STOP or a request counted."""


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


class Mutes:
    """The muted identities, by session, and what counted of them. Times are in seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._intervals: dict[str, float] = {}
        self._counted: dict[tuple[str, str], tuple[float, str]] = {}
        self._cause: StopCause | None = None

    def add(self, session: str, interval: float = STOP_INTERVAL) -> None:
        """Mute ``session``: one STOP and one request count per ``interval`` [s]."""
        self._intervals[session] = interval

    def remove(self, session: str) -> None:
        """End the mute of ``session``, if it is muted."""
        self._intervals.pop(session, None)

    def interval(self, session: str) -> float | None:
        """Return the interval of ``session`` [s]; None unless it is muted."""
        return self._intervals.get(session)

    @property
    def sessions(self) -> tuple[str, ...]:
        """All muted sessions."""
        return tuple(self._intervals)

    def follow(self, cause: StopCause | None) -> None:
        """Count the press that stopped the arm, on whatever path it came.

        ``cause``: cause of the present stop; None while the arm is not stopped. Call this often.
        """
        if cause is not None and cause != self._cause:
            self._note(session_of(cause.key), "STOP", cause.press)
        self._cause = cause

    def count_stop(self, session: str, interval: float | None, press: str | None = None) -> None:
        """Count a STOP of ``session``, whose interval is ``interval`` [s]; None: it is not muted.

        A repetition of the ``press`` that counted last counts too. Raises MutedError if the STOP
        does not count.
        """
        self._count(session, "STOP", interval, press or "")

    def count_request(self, session: str) -> None:
        """Count a request of ``session``. Raises MutedError if it does not count."""
        self._count(session, "request", self.interval(session))

    def _count(self, session: str, what: str, interval: float | None, press: str = "") -> None:
        if interval is None:
            return
        before, counted = self._counted.get((session, what), (-math.inf, ""))
        if press and press == counted:
            return
        wait = before + interval - self._clock()
        if wait > 0.0:
            raise MutedError(what, wait)
        self._note(session, what, press)

    def _note(self, session: str, what: str, press: str) -> None:
        self._counted.pop((session, what), None)
        self._counted[session, what] = self._clock(), press
        while len(self._counted) > MAX_COUNTED:
            del self._counted[next(iter(self._counted))]
