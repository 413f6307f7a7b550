"""A serial port by pyserial, the extra ``serial``, which is loaded when a port is opened."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from katana450.errors import KatanaError
from katana450.extras import library


class SerialPort:
    """An open serial port: 8 bits, no parity, one stop bit, no flow control."""

    def __init__(self, name: str, baud: int, device: str, lost: type[KatanaError]) -> None:
        """Open the port for this program alone: two programs would spoil each other's replies.

        Args:
            name: the port, such as /dev/ttyUSB0 or COM3.
            baud: rate [bit/s].
            device: the device behind it, for messages.
            lost: the error of a port that cannot be opened or is lost.

        Raises:
            MissingExtraError: pyserial is not installed.
            KatanaError: ``lost``.
        """
        serial = library("serial", "serial", "Serial ports")
        self._device, self._lost = device, lost
        try:
            self._port: Any = serial.Serial(name, baud, exclusive=True)
        except (OSError, ValueError) as error:
            raise lost(
                f"The serial port {name} cannot be opened: {error}. List the ports by `python -m "
                "serial.tools.list_ports`. On Linux the user must be in the group dialout."
            ) from None
        # Without it many adapters for USB collect bytes for 16 ms. Not all have it.
        with suppress(AttributeError, OSError, ValueError):
            self._port.set_low_latency_mode(True)

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` within ``timeout`` [s], and drop what has arrived without a request.

        Raises the error of a lost port.
        """
        with self._reporting():
            self._port.reset_input_buffer()
            if self._port.write_timeout != timeout:
                self._port.write_timeout = timeout
            self._port.write(data)

    def read(self, timeout: float) -> bytes:
        """Return what has arrived; nothing after ``timeout`` [s].

        Raises the error of a lost port.
        """
        with self._reporting():
            if self._port.timeout != timeout:
                self._port.timeout = timeout
            data: bytes = self._port.read(max(self._port.in_waiting, 1))
            return data

    def close(self) -> None:
        """Close the port, which may be lost."""
        with suppress(Exception):
            self._port.close()

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            # pyserial raises errors of many types for a port that was unplugged. That of the
            # terminal interface of POSIX is neither an OSError nor known on Windows.
            text = f"The serial connection to {self._device} is lost: {error}."
            raise self._lost(text) from None
