"""The interface of a connection that carries bytes, and its errors."""

from __future__ import annotations

from typing import Protocol

from katana450.errors import KatanaError
from katana450.extensions.real_arm.codec.replies import FirmwareError


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
