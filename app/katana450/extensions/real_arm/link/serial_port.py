"""The connection to an arm with a serial port. Needs pyserial, the extra ``serial``."""

from __future__ import annotations

from katana450.errors import ConfigurationError
from katana450.extensions.real_arm.link.transport import LinkLostError

PORT_ERRORS = (OSError, TypeError, ValueError)
"""Errors that pyserial raises, also for a port that was unplugged."""

BAUD = 57_600
"""Speed of every arm with a serial port; 8 bits, no parity, one stop bit, no flow control."""


class SerialTransport:
    """A serial port. Bytes without a request are dropped, as noise can bring them."""

    def __init__(self, path: str) -> None:
        """Open ``path``, such as /dev/ttyUSB0 or COM3.

        Raises LinkLostError, and ConfigurationError if pyserial is not installed.
        """
        try:
            import serial
        except ImportError:
            raise ConfigurationError(
                "A serial arm needs pyserial: run pip install 'katana450[serial]'."
            ) from None
        try:
            # Two programs at one arm would spoil the replies of each other.
            self._port = serial.Serial(path, BAUD, exclusive=True)
        except PORT_ERRORS as error:
            raise LinkLostError(f"The serial port {path} cannot be opened: {error}.") from None

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` within ``timeout`` [s]. Raises LinkLostError."""
        try:
            self._port.reset_input_buffer()
            self._port.write_timeout = timeout
            self._port.write(data)
        except PORT_ERRORS as error:
            raise LinkLostError(f"The serial connection to the arm broke: {error}.") from None

    def read(self, timeout: float) -> bytes:
        """Return what has arrived; nothing after ``timeout`` [s]. Raises LinkLostError."""
        try:
            self._port.timeout = timeout
            data: bytes = self._port.read(max(self._port.in_waiting, 1))
        except PORT_ERRORS as error:
            raise LinkLostError(f"The serial connection to the arm broke: {error}.") from None
        return data

    def close(self) -> None:
        """Close the port."""
        self._port.close()
