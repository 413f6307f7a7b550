"""Connections to a Katana450, and exchanges with it, each within a deadline."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from logging.handlers import RotatingFileHandler
from pathlib import Path

from katana450.errors import ConfigurationError, KatanaError
from katana450.extensions.device_address import DeviceAddress, Port
from katana450.extensions.real_arm.codec.codecs import HostCodec, OutOfStepError
from katana450.extensions.real_arm.codec.replies import ArmReply, FirmwareError, RefusedReply
from katana450.extensions.real_arm.codec.requests import ArmRequest, ErrorQuery


class LinkLostError(KatanaError):
    """The connection to the arm is lost, silent or out of step: it cannot be used any more."""


class ArmRefusalError(KatanaError):
    """The arm refused a request. The connection can still be used.

    Attributes:
        error: The reason that the arm gave.
    """

    def __init__(self, error: FirmwareError) -> None:
        super().__init__(error.sentence)
        self.error = error


PORT = 5566
"""TCP port of every arm."""

BAUD = 57_600
"""[bit/s] Rate of every arm with a serial port."""


def open_arm(address: DeviceAddress) -> Port:
    """Connect to the arm at ``address``. Raises LinkLostError and ConfigurationError."""
    return address.open(BAUD, "the arm", LinkLostError)


MAX_LOG_BYTES = 32_000_000
"""Size of a file after which a new one is begun. One older file is kept, with the suffix .1."""

SENT, RECEIVED, CONNECTED = ">", "<", "="
"""Marks of a line: bytes to the arm, bytes from it, and a new connection."""


class ExchangeLog(RotatingFileHandler):
    """A file with a line for each write and read.

    A line holds the time [s since 1970], a mark, and the bytes as hexadecimal numbers.
    """

    def __init__(self, path: Path) -> None:
        """Open ``path``, which is continued. Raises ConfigurationError."""
        try:
            super().__init__(path, maxBytes=MAX_LOG_BYTES, backupCount=1, encoding="ascii")
        except OSError as error:
            raise ConfigurationError(
                f"The log {path} cannot be written: {error.strerror}."
            ) from error

    def note(self, mark: str, data: bytes = b"") -> None:
        """Write a line."""
        row = f"{time.time():.6f} {mark} {data.hex(' ')}".rstrip()
        self.handle(logging.makeLogRecord({"msg": row}))

    def handleError(self, record: logging.LogRecord) -> None:
        """Do nothing: a full disk ends neither the motion of an arm nor the log."""


EXCHANGE_TIMEOUT = 0.3
"""[s] Deadline of an exchange. With the time between two exchanges it is less than the silence for
which the driver takes an arm for lost."""


class ArmLink:
    """An arm that answers requests, one at a time.

    Attributes:
        heard_at: Time at which the newest request that the arm has answered was sent [s], at first
            that of the connection. A reply that is read late counts for no longer.
    """

    def __init__(
        self,
        transport: Port,
        clock: Callable[[], float] = time.perf_counter,
        log: ExchangeLog | None = None,
    ) -> None:
        """Use ``transport``, by the time of ``clock``; ``log``: file of all that passes."""
        self._transport = transport
        self._clock = clock
        self._log = log
        self._note(CONNECTED)
        self._codec = HostCodec()
        self._is_lost = False
        self.heard_at = clock()

    def exchange(self, request: ArmRequest, timeout: float = EXCHANGE_TIMEOUT) -> ArmReply:
        """Return the reply of the arm to ``request``.

        Raises:
            ArmRefusalError: The arm refused it; its reason has been fetched.
            LinkLostError: There was no complete reply within ``timeout`` [s], or a wrong one. The
                connection is closed. Whether the arm executed the request is not known.
            InputError: A number does not fit into the request. Nothing was sent.
        """
        reply = self._reply_to(request, timeout)
        if isinstance(reply, RefusedReply):
            reason = self._reply_to(ErrorQuery(), timeout)
            if isinstance(reason, FirmwareError):
                raise ArmRefusalError(reason)
            raise ArmRefusalError(FirmwareError(request.HEAD[0], -1, 0, "no reason given"))
        if not request.is_confirmed_by(reply):
            raise ArmRefusalError(FirmwareError(request.HEAD[0], -1, 0, "no axis confirmed"))
        return reply

    def close(self) -> None:
        """End the connection."""
        self._transport.close()

    def _reply_to(self, request: ArmRequest, timeout: float) -> ArmReply:
        if self._is_lost:
            raise LinkLostError("The connection to the arm was lost: connect again.")
        data = self._codec.send(request)
        start = self._clock()
        try:
            self._note(SENT, data)
            self._transport.write(data, timeout)
            while (reply := self._codec.receive(self._read(start + timeout))) is None:
                pass
        except (LinkLostError, OutOfStepError) as error:
            self._is_lost = True
            self.close()
            raise LinkLostError(str(error)) from None
        self.heard_at = start
        return reply

    def _read(self, deadline: float) -> bytes:
        left = deadline - self._clock()
        data = self._transport.read(left) if left > 0.0 else b""
        self._note(RECEIVED, data)
        if not data:
            raise LinkLostError("The arm does not answer.")
        return data

    def _note(self, mark: str, data: bytes = b"") -> None:
        if self._log is not None:
            self._log.note(mark, data)
