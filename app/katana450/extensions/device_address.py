"""The address of a device: a TCP port or a serial port, and the connection to it."""

from __future__ import annotations

import re
import socket
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import urlsplit

from katana450.errors import InputError, KatanaError
from katana450.extensions.serial_port import SerialPort

RECEIVED_BYTES = 4096

QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)
"""Option of Linux that acknowledges at once: an acknowledgement held back for 40 ms may be the 40
ms of a reply that drivers of real arms report."""

CONNECT_TIMEOUT = 1.0
"""[s] Longest time that an attempt to connect may take."""


class Port(Protocol):
    """A connection that carries bytes. Its methods raise the error of a lost port."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of ``data`` at once within ``timeout`` [s]."""
        ...

    def read(self, timeout: float) -> bytes:
        """Return what has arrived, or nothing if that takes longer than ``timeout`` [s]."""
        ...

    def close(self) -> None:
        """End the connection. May be called twice."""
        ...


class TcpPort:
    """A TCP connection. Each request is one write, and small segments are not held back."""

    def __init__(
        self, host: str, port: int, device: str, lost: type[KatanaError], *, drops_unread: bool
    ) -> None:
        """Connect to ``device``.

        Args:
            host: name or IP address.
            port: its TCP port.
            device: the device behind it, for messages.
            lost: the error of a connection that cannot be made or is lost.
            drops_unread: whether bytes that wait when a request is sent are dropped. Otherwise the
                connection is lost by them.

        Raises ``lost``.
        """
        self._device, self._lost, self._drops_unread = device, lost, drops_unread
        try:
            self._socket = socket.create_connection((host, port), CONNECT_TIMEOUT)
        except (OSError, UnicodeError) as error:
            raise lost(
                f"There is no connection to {device} at {host}, port {port}: {_reason(error)}."
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` in one write within ``timeout`` [s]. Raises the error of a lost port."""
        try:
            self._socket.setblocking(False)
            with suppress(BlockingIOError):
                while unread := self._socket.recv(RECEIVED_BYTES):
                    if not self._drops_unread:
                        text = f"sent bytes without a request ({unread[:8].hex(' ')})"
                        raise self._error(text)
                raise self._error("closed the connection")
            self._socket.settimeout(timeout)
            self._socket.sendall(data)
        except OSError as error:
            raise self._broken(error) from None

    def read(self, timeout: float) -> bytes:
        """Return what has arrived; nothing after ``timeout`` [s].

        Raises the error of a lost port.
        """
        try:
            self._socket.settimeout(timeout)
            if QUICK_ACK is not None:
                # The system clears this option by itself.
                self._socket.setsockopt(socket.IPPROTO_TCP, QUICK_ACK, 1)
            data = self._socket.recv(RECEIVED_BYTES)
        except TimeoutError:
            return b""
        except OSError as error:
            raise self._broken(error) from None
        if not data:
            raise self._error("closed the connection")
        return data

    def close(self) -> None:
        """End the connection. May be called twice."""
        self._socket.close()

    def _error(self, text: str) -> KatanaError:
        return self._lost(f"{self._device[0].upper()}{self._device[1:]} {text}.")

    def _broken(self, error: Exception) -> KatanaError:
        return self._lost(f"The connection to {self._device} broke: {_reason(error)}.")


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()


SERIAL_NAME = re.compile(r"/.+|COM\d+", re.IGNORECASE)
"""A serial port without the word ``serial://``."""


@dataclass(frozen=True)
class DeviceAddress:
    """Address of a device.

    Attributes:
        host: Name or IP address, or the path of a serial port.
        port: TCP port; None for a serial port.
    """

    host: str
    port: int | None

    @classmethod
    def parse(cls, text: str, default_port: int) -> DeviceAddress:
        """Return the address in ``text``: tcp://HOST[:PORT], serial://PATH, or a serial port.

        Raises InputError.
        """
        scheme, separator, rest = text.partition("://")
        if SERIAL_NAME.fullmatch(text) or (scheme == "serial" and separator and rest):
            return cls(rest or text, None)
        try:
            parts = urlsplit(text)
            host, port = parts.hostname, parts.port
        except ValueError:
            host = port = None
        if scheme != "tcp" or not host or port == 0 or text.count("/") > 2:
            raise InputError(
                f"{text!r} is not the address of a device: give tcp://HOST, tcp://HOST:PORT, or a "
                "serial port such as /dev/ttyACM0 or COM3."
            )
        return cls(host, default_port if port is None else port)

    def open(
        self, baud: int, device: str, lost: type[KatanaError], *, drops_unread: bool = False
    ) -> Port:
        """Connect to ``device`` and return the connection.

        Args:
            baud: rate of a serial port [bit/s].
            device: the device, for messages.
            lost: the error of a connection that cannot be made or is lost.
            drops_unread: see ``TcpPort``; a serial port drops them always.

        Raises ``lost`` and ConfigurationError.
        """
        if self.port is None:
            return SerialPort(self.host, baud, device, lost)
        return TcpPort(self.host, self.port, device, lost, drops_unread=drops_unread)

    def __str__(self) -> str:
        if self.port is None:
            return f"serial://{self.host}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp://{host}:{self.port}"
