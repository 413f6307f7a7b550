"""The message filter, which checks every message of a browser to viser.

This module checks size and rate. ``katana450.server.viser_bridge.guard`` defines the form of the
messages that our page can send. `CommandGate` decides which participant may command.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import msgspec
from viser import _messages as wire

from katana450.server.service.limits import TokenBucket
from katana450.server.viser_bridge.guard import Guard
from katana450.server.web.security import MAX_MESSAGE_BYTES

log = logging.getLogger(__name__)

RATE, BURST = 150.0, 300.0
"""Maximum messages per second, and at once. viser's page sends each type at most 20 times/s."""

MAX_BAD_MESSAGES, FORGIVEN_PER_SECOND = 100.0, 1.0
"""Number of bad messages after which a connection is closed, and how many expire per second."""

NO_MESSAGE = 25.0
"""Number of bad messages for which an unreadable message counts."""

SEEN = "Seen"
"""Type of our script's message with the number of frames on the screen, which viser never gets."""

MADE = "made"
"""Field that our script adds to each message, with the time of its making [s] on the page's clock.
viser never gets it."""


class Ruling(Enum):
    """The decision on a message. ``CLOSE`` drops it and closes the connection."""

    PASS = auto()
    DROP = auto()
    CLOSE = auto()


@dataclass(frozen=True)
class FilterResult:
    """The result for one message.

    Attributes:
        ruling: the decision.
        seen: number of frames on the screen if the message reports it.
        message: the decoded message if it passes.
        made: time of its making [s] on the clock of the page; None if it has none.
    """

    ruling: Ruling
    seen: int | None = None
    message: Any = None
    made: float | None = None


class MessageFilter:
    """The filter of one connection."""

    def __init__(self, guard: Guard, who: str, t: float) -> None:
        """Begin at ``t`` [s]; ``who`` names the sender in the log."""
        self._guard = guard
        self._who = who
        self._flood = TokenBucket(RATE, BURST, t)
        self._tolerance = TokenBucket(FORGIVEN_PER_SECOND, MAX_BAD_MESSAGES, t)

    def judge(self, data: bytes | None, t: float) -> FilterResult:
        """Return the result for a message that came at ``t`` [s]; ``data`` is None for a text."""
        if not self._flood.take(t):
            return self._drop("flood", "messages come too fast", t)
        if data is None or len(data) > MAX_MESSAGE_BYTES:
            return self._drop("none", "it is too long or not binary", t, NO_MESSAGE)
        try:
            fields = msgspec.msgpack.decode(data)
            sent = fields.pop(MADE, None)
            if sent is not None and not math.isfinite(sent):
                raise ValueError
            match fields:
                case {"type": str(kind), "count": int(count), **rest} if kind == SEEN and not rest:
                    return FilterResult(Ruling.DROP, seen=count, made=sent)
            message = wire.Message.deserialize(msgspec.msgpack.encode(fields))
        except Exception as error:
            # A message that viser's decoder rejects, by any error, is not passed to viser.
            return self._drop("none", f"it cannot be read ({type(error).__name__})", t, NO_MESSAGE)
        objection = self._guard.objection(message)
        if objection is not None:
            return self._drop(type(message).__name__, objection, t)
        return FilterResult(Ruling.PASS, message=message, made=sent)

    def _drop(self, kind: str, objection: str, t: float, weight: float = 1.0) -> FilterResult:
        log.warning("Dropped a %s of %s: %s.", kind, self._who, objection)
        tolerated = self._tolerance.take(t, weight)
        return FilterResult(Ruling.DROP if tolerated else Ruling.CLOSE)
