"""Every message of a browser to viser is decoded here, and passes or does not.

The shape of each message that our page can send is defined in
``katana450.server.viser_bridge.guard``. Here is the rest: how large, how often. Who may command is
decided by `CommandGate`.
"""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import dataclass
from enum import Enum, auto

import msgspec
from viser import _messages as wire

from katana450.server.viser_bridge.guard import Guard
from katana450.server.web.token_bucket import TokenBucket

log = logging.getLogger(__name__)

MAX_MESSAGE_BYTES = 16_384
"""Bytes of a message: a typed text of 200 characters is the longest there is."""

RATE, BURST = 150.0, 300.0
"""Messages a second, and at once. viser's page sends each kind at most 20 times a second."""

MAX_BAD_MESSAGES, FORGIVEN_PER_SECOND = 100.0, 1.0
"""Bad messages until their sender is closed, and how many a second are forgotten."""

NO_MESSAGE = 25.0
"""A message that cannot even be read counts as this many."""

SEEN = "Seen"
"""What our script says of frames on the screen, on the same line; not for viser."""

MAX_LOGGED_MESSAGES = 20
"""Bad messages of one browser that are logged one by one; a flood must not fill the log."""


class Ruling(Enum):
    """What becomes of a message."""

    PASS = auto()
    DROP = auto()
    CLOSE = auto()
    """It is dropped, and its sender is to be closed."""


@dataclass(frozen=True)
class FilterResult:
    """On one message.

    Attributes:
        ruling: what becomes of it.
        seen: how many frames are on the screen, where the message was about that.
    """

    ruling: Ruling
    seen: int | None = None


class MessageFilter:
    """In front of viser, for one connection."""

    def __init__(self, guard: Guard, who: str, t: float) -> None:
        """``who``: for the log. ``t``: now [s]."""
        self._guard = guard
        self._who = who
        self._flood = TokenBucket(RATE, BURST, t)
        self._patience = TokenBucket(FORGIVEN_PER_SECOND, MAX_BAD_MESSAGES, t)
        self.dropped: Counter[str] = Counter()
        """Bad messages by their type."""

    def judge(self, data: bytes | None, t: float) -> FilterResult:
        """Of a message that came at ``t`` [s]; ``data`` is None for one of text."""
        if not self._flood.take(t):
            return self._drop("flood", "it comes too fast", t)
        if data is None or len(data) > MAX_MESSAGE_BYTES:
            return self._drop("none", "it is too long or no bytes", t, NO_MESSAGE)
        seen = _seen(data)
        if seen is not None:
            return FilterResult(Ruling.DROP, seen=seen)
        try:
            message = wire.Message.deserialize(data)
        except Exception as error:
            # Whatever viser's decoder stumbles over is not for it.
            return self._drop("none", f"it cannot be read ({type(error).__name__})", t, NO_MESSAGE)
        objection = self._guard.objection(message)
        if objection is not None:
            return self._drop(type(message).__name__, objection, t)
        return FilterResult(Ruling.PASS)

    def _drop(self, kind: str, objection: str, t: float, weight: float = 1.0) -> FilterResult:
        self.dropped[kind] += 1
        told = self.dropped.total()
        if told <= MAX_LOGGED_MESSAGES:
            log.warning("Dropped a %s of %s: %s.", kind, self._who, objection)
        if told == MAX_LOGGED_MESSAGES:
            log.warning("More of %s is dropped without a word.", self._who)
        patient = self._patience.take(t, weight)
        return FilterResult(Ruling.DROP if patient else Ruling.CLOSE)


def _seen(data: bytes) -> int | None:
    try:
        message = msgspec.msgpack.decode(data)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return None
    match message:
        case {"type": str(kind), "count": int(count), **rest} if kind == SEEN and not rest:
            return count
    return None
