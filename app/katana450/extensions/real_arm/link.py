"""Connections to an arm by TCP or a serial port, and exchanges, each within a deadline."""

from __future__ import annotations

import logging
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from katana450.errors import ConfigurationError, InputError, KatanaError
from katana450.extensions.real_arm.codec.codecs import HostCodec, OutOfStepError
from katana450.extensions.real_arm.codec.replies import ArmReply, FirmwareError, RefusedReply
from katana450.extensions.real_arm.codec.requests import ArmRequest, ErrorQuery
from katana450.extensions.serial_port import SerialPort


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


class Transport(Protocol):
    """A connection that carries bytes. Its methods raise LinkLostError."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of ``data`` at once within ``timeout`` [s]."""
        ...

    def read(self, timeout: float) -> bytes:
        """Return what has arrived, or nothing if that takes longer than ``timeout`` [s]."""
        ...

    def close(self) -> None:
        """End the connection. May be called twice."""
        ...


PORT = 5566
"""TCP port of every arm."""

RECEIVED_BYTES = 4096

QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)
"""Option of Linux that acknowledges at once: an acknowledgement held back for 40 ms may be the 40
ms of a reply that drivers of real arms report."""


class TcpTransport:
    """A TCP connection. Each request is one write, and small segments are not held back."""

    def __init__(self, host: str, port: int = PORT, timeout: float = 1.0) -> None:
        """Connect within ``timeout`` [s]. Raises LinkLostError."""
        try:
            self._socket = socket.create_connection((host, port), timeout)
        except (OSError, UnicodeError) as error:
            raise LinkLostError(
                f"There is no connection to an arm at {host}, port {port}: {_reason(error)}."
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` in one write. Raises LinkLostError, also if bytes wait to be read."""
        try:
            self._socket.setblocking(False)
            with suppress(BlockingIOError):
                unread = self._socket.recv(RECEIVED_BYTES)
                raise LinkLostError(
                    f"The arm sent bytes without a request ({unread[:8].hex(' ')})."
                    if unread
                    else "The arm closed the connection."
                )
            self._socket.settimeout(timeout)
            self._socket.sendall(data)
        except OSError as error:
            raise LinkLostError(f"The connection to the arm broke: {_reason(error)}.") from None

    def read(self, timeout: float) -> bytes:
        """Return what has arrived; nothing after ``timeout`` [s]. Raises LinkLostError."""
        try:
            self._socket.settimeout(timeout)
            if QUICK_ACK is not None:
                # The system clears this option by itself.
                self._socket.setsockopt(socket.IPPROTO_TCP, QUICK_ACK, 1)
            data = self._socket.recv(RECEIVED_BYTES)
        except TimeoutError:
            return b""
        except OSError as error:
            raise LinkLostError(f"The connection to the arm broke: {_reason(error)}.") from None
        if not data:
            raise LinkLostError("The arm closed the connection.")
        return data

    def close(self) -> None:
        """End the connection."""
        self._socket.close()


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()


BAUD = 57_600
"""[bit/s] Rate of every arm with a serial port."""


CONNECT_TIMEOUT = 1.0
"""[s] Longest time that an attempt to connect may take."""


@dataclass(frozen=True)
class ArmUrl:
    """Address of an arm.

    Attributes:
        host: Name or IP address, or the path of a serial port.
        port: TCP port; None for a serial port.
    """

    host: str
    port: int | None = PORT

    @classmethod
    def parse(cls, text: str) -> ArmUrl:
        """Return the address in ``text``: tcp://HOST[:PORT] or serial://PATH.

        Raises InputError.
        """
        scheme, separator, rest = text.partition("://")
        if scheme == "serial" and separator and rest:
            return cls(rest, None)
        try:
            parts = urlsplit(text)
            host, port = parts.hostname, parts.port
        except ValueError:
            host = port = None
        if scheme != "tcp" or not host or port == 0 or text.count("/") > 2:
            raise InputError(
                f"{text!r} is not the address of an arm: give tcp://HOST, tcp://HOST:PORT, or "
                "serial://PATH such as serial:///dev/ttyUSB0."
            )
        return cls(host, PORT if port is None else port)

    def open(self) -> Transport:
        """Connect, and return the connection. Raises LinkLostError and ConfigurationError."""
        if self.port is None:
            return SerialPort(self.host, BAUD, "the arm", LinkLostError)
        return TcpTransport(self.host, self.port, CONNECT_TIMEOUT)

    def __str__(self) -> str:
        if self.port is None:
            return f"serial://{self.host}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp://{host}:{self.port}"


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

KEPT_ROUND_TRIPS = 1000


class ArmLink:
    """An arm that answers requests, one at a time.

    Attributes:
        round_trips: Times of the newest exchanges [s].
        heard_at: Time at which the newest request that the arm has answered was sent [s], at first
            that of the connection. A reply that is read late counts for no longer.
    """

    def __init__(
        self,
        transport: Transport,
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
        self.round_trips: deque[float] = deque(maxlen=KEPT_ROUND_TRIPS)

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
        self.round_trips.append(self._clock() - start)
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
