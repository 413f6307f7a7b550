"""Time of the newest heartbeat of each participant, by the receipt of its message.

A message can carry the time of its making on the sender's own clock. The difference between the two
clocks is part of every delay, so only the excess over the least delay of the connection says how
late a message is. A delay that was always there looks like a difference between the clocks.
"""

from __future__ import annotations

import math
import socket
import time
from collections import deque
from collections.abc import Callable

from katana450.arm.runtime.readiness import SocketChannel, ack_age, data_age, readable
from katana450.errors import LateError

KEEPALIVE = {"TCP_KEEPIDLE": 1, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 2}
"""Keepalive of TCP [s, s, probes]. A host that disappears is detected within 3 s."""

ARRIVAL = "katana450.arrival"
"""Key of the ``LastHeartbeat`` in the scope of a websocket."""

PING = "katana450.ping"
"""Key of the function in the scope of a websocket that sends a ping of the protocol. The answer of
the client counts as a heartbeat."""

MAX_ACK_AGE = 3.0
"""[s] Age of the newest acknowledgement from which on an open connection counts as lost. The kernel
sends no probes while data waits for its acknowledgement, so keepalive does not see such a loss."""

RECENT_MESSAGES = 8
"""Number of handled messages whose least delay is that of the unread ones: those that a busy server
handles late seem to be delayed."""


WINDOW = 10.0
"""[s] Time after which a longer delay counts as usual, as after a change of the route or a drift of
the clocks."""

MIN_MESSAGES = 10
"""Minimum number of messages in that time, so that a single late one does not count as usual."""


class LastHeartbeat:
    """The newest heartbeat of one participant.

    A message counts from its arrival, which the kernel stamps, so late handling does not make the
    heartbeat later, and a message that waits for a busy server does not count as silence. Without a
    socket it counts from its handling. A message with the time of its making counts from the time
    at which it would have arrived with the least delay of its connection: a late one does not prove
    that the sender is there now.

    Attributes:
        open: Number of its requests that wait for the end of a motion. While there is one, its open
            connection counts as a heartbeat.
        pinged: Whether it answers pings, so that an open connection alone is no heartbeat.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, line: SocketChannel | None = None
    ) -> None:
        """Count the participant as alive now. ``clock`` is in seconds. ``line``: its socket."""
        self._clock, self._line = clock, line
        self._newest = clock()
        self._least_delay = LeastDelay()
        self._delays: deque[float] = deque(maxlen=RECENT_MESSAGES)
        self.open = 0
        self.pinged = False

    def note(self, sent: float | None = None, limit: float = math.inf) -> float:
        """Note that a message of the participant is being handled; return its delay [s].

        ``sent``: time of its making [s] on the clock of the participant. Without it the message
        counts from its receipt, and its delay is 0. The delay, and ``limit``, are those of
        ``LeastDelay.excess``.
        """
        t, delay = self._clock(), 0.0
        if sent is None:
            received = t - self._age()
        else:
            delay = self._least_delay.excess(sent, t, limit)
            received = t - delay
            self._delays.append(delay)
        self._newest = max(self._newest, received)
        return delay

    @property
    def delay(self) -> float:
        """Delay of the messages [s] beyond the least; 0 without times of their making."""
        return min(self._delays, default=0.0)

    @property
    def newest(self) -> float:
        """Time of the newest heartbeat [s], including a message that is not read yet."""
        line = self._line
        if line is not None and readable(line.fileno()):
            self._newest = max(self._newest, self._clock() - self._age() - self.delay)
        waits = self.open and not self.pinged
        if waits and (line is None or ack_age(line) < MAX_ACK_AGE):
            return self._clock()
        return self._newest

    def _age(self) -> float:
        """Return the age of the newest message [s]."""
        return 0.0 if self._line is None else data_age(self._line)


def keep_alive(listening: socket.socket) -> None:
    """Make the kernel probe idle connections that ``listening`` accepts from now on."""
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in KEEPALIVE.items():
        if hasattr(socket, name):
            listening.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


class LeastDelay:
    """The least recent delay of one connection. All times are arguments [s]."""

    def __init__(self) -> None:
        self._least = self._candidate = math.inf
        self._restart(-math.inf)

    def excess(self, sent: float, t: float, limit: float = math.inf) -> float:
        """Return how much longer than the least a message took that was made at ``sent``.

        ``sent`` is on the clock of the sender and ``t``, the present, on that of the receiver.
        ``limit``: excess [s] above which the message is not executed. While such messages come,
        their delay never counts as usual: a person who holds a key must let go first.
        """
        delay = t - sent
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


LATE_RETRY = 0.1
"""[s] Time after which a program can send another sample in place of a late one."""


def check_in_time(delay: float, limit: float) -> None:
    """Raise LateError for a sample with a ``delay`` above ``limit`` [s]."""
    if delay > limit:
        raise LateError(
            f"Not executed, because it arrived {delay:.1f} s late: the arm would still move after "
            "you let go. Let go, and drive again once the connection is as fast as before, or "
            f"after {WINDOW:g} s at its present speed."
        )
