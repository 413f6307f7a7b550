"""A serial port by pyserial, which is loaded when one is opened."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from katana450.errors import ConfigurationError, KatanaError

BAUD = 1_000_000
"""[bit/s] Rate of an STS3215 as delivered."""

READ_TIMEOUT = 0.005
"""[s] Time that one read waits for a byte."""


class UnpluggedError(KatanaError):
    """The leader's serial port is lost."""


class SerialPort:
    """An open serial port of this machine; see ``motor_bus.Port``."""

    def __init__(self, name: str) -> None:
        """Open the port ``name``, such as /dev/ttyUSB0 or COM3.

        Raises ConfigurationError if pyserial is not installed, or the port cannot be opened.
        """
        try:
            import serial
        except ImportError as error:
            raise ConfigurationError(
                "A leader arm needs pyserial: pip install 'katana450[serial]'."
            ) from error
        try:
            self._port: Any = serial.Serial(
                name, BAUD, timeout=READ_TIMEOUT, write_timeout=1.0, exclusive=True
            )
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f"The port {name} cannot be opened: {error}. List the ports by `python -m "
                "serial.tools.list_ports`; on Linux the user needs the group dialout."
            ) from error
        # Without it many adapters for USB collect bytes for 16 ms. Not all have it.
        with suppress(AttributeError, OSError, ValueError):
            self._port.set_low_latency_mode(True)
        # The driver of a port that was unplugged raises errors of several types.
        self._errors = (OSError, TypeError, ValueError)

    def write(self, data: bytes) -> None:
        """Send ``data``. Raises UnpluggedError."""
        try:
            self._port.write(data)
        except self._errors as error:
            raise self._unplugged(error) from error

    def read(self) -> bytes:
        """Return what has arrived, after READ_TIMEOUT at the latest. Raises UnpluggedError."""
        try:
            data: bytes = self._port.read(max(self._port.in_waiting, 1))
        except self._errors as error:
            raise self._unplugged(error) from error
        return data

    def discard(self) -> None:
        """Drop the bytes that wait to be read. Raises UnpluggedError."""
        try:
            self._port.read(self._port.in_waiting)
        except self._errors as error:
            raise self._unplugged(error) from error

    def close(self) -> None:
        """Close the port; it may be lost."""
        with suppress(*self._errors):
            self._port.close()

    def _unplugged(self, error: Exception) -> UnpluggedError:
        return UnpluggedError(f"The leader's port {self._port.name} is lost: {error}.")
