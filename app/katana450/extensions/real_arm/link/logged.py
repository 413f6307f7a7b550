"""A connection whose exchanges are written to a file, for people who look for a fault."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from katana450.errors import ConfigurationError
from katana450.extensions.real_arm.link.arm_url import ArmUrl
from katana450.extensions.real_arm.link.transport import Transport

MAX_LOG_BYTES = 32_000_000
"""Size of a file after which a new one is begun. One older file is kept, with the suffix .1."""

SENT, RECEIVED, CONNECTED = ">", "<", "="
"""Marks of a line: bytes to the arm, bytes from it, and a new connection."""


class ExchangeLog:
    """A file with a line for each write and read.

    A line holds the time [s since 1970], a mark, and the bytes as hexadecimal numbers.
    """

    def __init__(self, path: Path) -> None:
        """Open ``path``, which is continued. Raises ConfigurationError."""
        self._path = path
        self._file: TextIO | None = self._opened()

    def note(self, mark: str, data: bytes = b"") -> None:
        """Write a line. A full disk ends the log, not the motion of an arm."""
        if self._file is None:
            return
        try:
            self._file.write(f"{time.time():.6f} {mark} {data.hex(' ')}".rstrip() + "\n")
            if self._file.tell() > MAX_LOG_BYTES:
                self._file.close()
                os.replace(self._path, self._path.with_name(f"{self._path.name}.1"))
                self._file = self._opened()
        except (OSError, ConfigurationError):
            self._file = None

    def close(self) -> None:
        """End the log."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _opened(self) -> TextIO:
        try:
            # Line by line, so that a reader follows and a crash loses nothing.
            return self._path.open("a", encoding="ascii", buffering=1)
        except OSError as error:
            raise ConfigurationError(
                f"The log {self._path} cannot be written: {error.strerror}."
            ) from error


class LoggedTransport:
    """A connection that writes all that passes to a log."""

    def __init__(self, transport: Transport, log: ExchangeLog) -> None:
        self._transport, self._log = transport, log
        log.note(CONNECTED)

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` within ``timeout`` [s]. Raises LinkLostError."""
        self._log.note(SENT, data)
        self._transport.write(data, timeout)

    def read(self, timeout: float) -> bytes:
        """Return what has arrived within ``timeout`` [s]. Raises LinkLostError."""
        data = self._transport.read(timeout)
        self._log.note(RECEIVED, data)
        return data

    def close(self) -> None:
        """End the connection."""
        self._transport.close()


@dataclass(frozen=True)
class LoggedArmUrl(ArmUrl):
    """Address of an arm whose connections are written to a log.

    Attributes:
        log: The log; None for none.
    """

    log: ExchangeLog | None = None

    def open(self) -> Transport:
        """Connect, and return the connection. Raises LinkLostError and ConfigurationError."""
        transport = super().open()
        return transport if self.log is None else LoggedTransport(transport, self.log)
