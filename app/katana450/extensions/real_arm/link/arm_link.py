"""Exchanges of requests and replies with an arm, each within a deadline. Nothing is repeated."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from katana450.extensions.real_arm.codec.host_codec import (
    HostCodec,
    HostEvent,
    OutOfStep,
    ReplyReceived,
)
from katana450.extensions.real_arm.codec.replies import ArmReply, FirmwareError
from katana450.extensions.real_arm.codec.requests import ArmRequest, ErrorQuery
from katana450.extensions.real_arm.link.transport import (
    ArmRefusalError,
    LinkLostError,
    Transport,
)

EXCHANGE_TIMEOUT = 0.3
"""[s] Deadline of an exchange. With the time between two exchanges it is less than the silence for
which the driver takes an arm for lost."""

KEPT_ROUND_TRIPS = 1000


class ArmLink:
    """An arm that answers requests, one at a time.

    Attributes:
        round_trips: Times of the newest exchanges [s].
        heard_at: Time at which the newest request that the arm has answered was sent [s], at first
            that of the connection. A reply that is read late counts for no longer.
    """

    def __init__(
        self, transport: Transport, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._transport = transport
        self._clock = clock
        self._codec = HostCodec()
        self._is_lost = False
        self.heard_at = clock()
        self.round_trips: deque[float] = deque(maxlen=KEPT_ROUND_TRIPS)

    def exchange(self, request: ArmRequest, timeout: float = EXCHANGE_TIMEOUT) -> ArmReply:
        """Return the reply of the arm to ``request``.

        Raises:
            ArmRefusalError: The arm refused it; its reason has been fetched.
            LinkLostError: There was no complete reply within ``timeout`` [s], or a wrong one. The
                connection is closed. Whether the arm executed the request is not known.
            InputError: A number does not fit into the request. Nothing was sent.
        """
        event = self._event_of(request, timeout)
        if isinstance(event, ReplyReceived):
            if not request.is_confirmed_by(event.reply):
                raise ArmRefusalError(FirmwareError(request.HEAD[0], -1, 0, "no axis confirmed"))
            return event.reply
        reason = self._event_of(ErrorQuery(), timeout)
        if isinstance(reason, ReplyReceived) and isinstance(reason.reply, FirmwareError):
            raise ArmRefusalError(reason.reply)
        raise ArmRefusalError(FirmwareError(request.HEAD[0], -1, 0, "no reason given"))

    def close(self) -> None:
        """End the connection."""
        self._transport.close()

    def _event_of(self, request: ArmRequest, timeout: float) -> HostEvent:
        if self._is_lost:
            raise LinkLostError("The connection to the arm was lost: connect again.")
        data = self._codec.send(request)
        begun = self._clock()
        try:
            self._transport.write(data, timeout)
            while not (events := self._codec.receive(self._read(begun + timeout))):
                pass
            for event in events:
                if isinstance(event, OutOfStep):
                    raise LinkLostError(event.problem)
        except LinkLostError:
            self._is_lost = True
            self.close()
            raise
        self.heard_at = begun
        self.round_trips.append(self._clock() - begun)
        return events[0]

    def _read(self, deadline: float) -> bytes:
        left = deadline - self._clock()
        data = self._transport.read(left) if left > 0.0 else b""
        if not data:
            raise LinkLostError("The arm does not answer.")
        return data
