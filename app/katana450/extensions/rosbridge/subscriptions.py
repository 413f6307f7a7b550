"""The topics of one client, and which of them is due."""

from __future__ import annotations

import math
from collections.abc import Callable

from katana450.errors import InputError
from katana450.extensions.rosbridge import names
from katana450.extensions.rosbridge.ops import OpId, Subscribe
from katana450.extensions.rosbridge.publications import PERIODS

MAX_SUBSCRIPTIONS = 16
"""Maximum number of subscriptions of one client to one topic."""

RETRY_SECONDS = 0.1
"""[s] Time after which a topic that had no message is tried again."""

URGENT = (names.STATE, names.DIAGNOSTICS)
"""Topics that are due at once when a stop begins, is confirmed or is cleared."""


class Subscriptions:
    """The subscriptions of one client. A topic is sent at the rate of the fastest one.

    Its name is repeated as the client gave it, with or without the first slash.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin without subscriptions. ``clock`` is in seconds."""
        self._clock = clock
        self._intervals: dict[str, dict[OpId, float]] = {}
        self._due: dict[str, float] = {}

    def add(self, op: Subscribe) -> None:
        """Subscribe; a topic without an interval is sent again. Raises InputError."""
        name = names.resolved(op.topic)
        known = names.PUBLISHED.get(name)
        if known is None:
            of = "is only for commands" if name in names.COMMANDED else "does not exist"
            raise InputError(
                f"The topic {op.topic} {of}. The topics are {', '.join(names.PUBLISHED)}."
            )
        if op.type and not names.is_type(op.type, known):
            raise InputError(f"The messages of {op.topic} are {known}, not {op.type}.")
        if op.compression not in (None, "", "none"):
            raise InputError(f"There is no compression {op.compression[:40]!r}, only 'none'.")
        if op.fragment_size:
            raise InputError("Messages are not sent in fragments. Leave out fragment_size.")
        intervals = self._intervals.setdefault(op.topic, {})
        if op.id not in intervals and len(intervals) >= MAX_SUBSCRIPTIONS:
            raise InputError(f"A client can subscribe {MAX_SUBSCRIPTIONS} times to a topic.")
        intervals[op.id] = max(PERIODS.get(name, 0.0), 1e-3 * op.throttle_rate)
        self._due[op.topic] = self._clock()

    def remove(self, topic: str, op_id: OpId) -> None:
        """End the subscription ``op_id``, or all if it is None. Raises InputError without one."""
        intervals = self._intervals.get(topic)
        if intervals is None or (op_id is not None and op_id not in intervals):
            raise InputError(f"There is no subscription {op_id!r} of {topic}.")
        if op_id is not None:
            del intervals[op_id]
        if op_id is None or not intervals:
            del self._intervals[topic]
            self._due.pop(topic, None)

    def hurry(self) -> None:
        """Make the topics that report a stop due."""
        for topic in self._due:
            if names.resolved(topic) in URGENT:
                self._due[topic] = self._clock()

    def next_due(self) -> tuple[str | None, float | None]:
        """Return the topic that has been due longest, and the time until the next one [s]."""
        if not self._due:
            return None, None
        topic, at = min(self._due.items(), key=lambda each: each[1])
        left = at - self._clock()
        if left > 0.0:
            return None, left if math.isfinite(left) else None
        return topic, 0.0

    def sent(self, topic: str) -> None:
        """Note that a message of ``topic`` is being sent now."""
        if names.resolved(topic) not in PERIODS:
            del self._due[topic]
            return
        t, interval = self._clock(), min(self._intervals[topic].values())
        # Late messages are not sent twice to catch up.
        self._due[topic] = max(self._due[topic] + interval, t)

    def missed(self, topic: str) -> None:
        """Note that there is no message of ``topic`` yet."""
        self._due[topic] = self._clock() + RETRY_SECONDS

    def delay(self, seconds: float) -> None:
        """Make nothing due for ``seconds`` [s]."""
        earliest = self._clock() + seconds
        self._due = {topic: max(at, earliest) for topic, at in self._due.items()}
