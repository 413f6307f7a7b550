"""Addresses of arms as people type them."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import urlsplit

from katana450.errors import InputError
from katana450.extensions.real_arm.link.serial_port import serial_transport
from katana450.extensions.real_arm.link.tcp import PORT, TcpTransport
from katana450.extensions.real_arm.link.transport import Transport

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
        scheme, found, rest = text.partition("://")
        if scheme == "serial" and found and rest:
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
            return serial_transport(self.host)
        return TcpTransport(self.host, self.port, CONNECT_TIMEOUT)

    def __str__(self) -> str:
        if self.port is None:
            return f"serial://{self.host}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp://{host}:{self.port}"
