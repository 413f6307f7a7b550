"""The connection to an arm with a serial port."""

from __future__ import annotations

from katana450.extensions.real_arm.link.transport import LinkLostError
from katana450.extensions.serial_port import SerialPort

BAUD = 57_600
"""[bit/s] Rate of every arm with a serial port."""


def serial_transport(path: str) -> SerialPort:
    """Open ``path``, such as /dev/ttyUSB0 or COM3.

    Raises LinkLostError, and ConfigurationError if pyserial is not installed.
    """
    return SerialPort(path, BAUD, "the arm", LinkLostError)
