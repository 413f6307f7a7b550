"""Exchanges with Feetech servos at one bus, each within a deadline.

The bus is a serial port, or a TCP port that passes all bytes on to one, as ser2net does.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping

from katana450.errors import InputError, KatanaError
from katana450.extensions.device_address import DeviceAddress, Port
from katana450.extensions.motor_bus.calibration import MotorCalibration
from katana450.extensions.motor_bus.packets import (
    HOMING_OFFSET,
    MAX_POSITION,
    MIN_POSITION,
    MotorError,
    Packet,
    PacketReader,
    Register,
    ping_request,
    read_request,
    sync_read_request,
    sync_write_request,
    write_request,
)

BAUD = 1_000_000
"""[bit/s] Rate of an STS3215 as delivered."""

PORT = 5567
"""TCP port of a bus, if the address names none."""

DEADLINE = 0.05
"""[s] Timeout for the answers to a request. Adapters for USB hold bytes back for up to 16 ms."""

SCAN_DEADLINE = 0.02
"""[s] The same for an id at which there may be no motor."""

READ_TIMEOUT, WRITE_TIMEOUT = 0.005, 1.0
"""[s] Timeouts of one read, which may return a part of an answer, and of a request."""

TRIES = 3
"""Number of times that a request is sent before the motor counts as silent."""


class SilentMotorError(KatanaError):
    """A motor does not answer."""


class BusLostError(KatanaError):
    """The port of the bus cannot be opened, or is lost."""


def open_port(address: DeviceAddress, device: str) -> Port:
    """Open the bus at ``address``. ``device``: what is there, for messages. Raises BusLostError."""
    return address.open(BAUD, device, BusLostError, drops_unread=True)


class MotorBus:
    """The motors at one port, asked one request at a time.

    Attributes:
        heard_at: time of the newest request that a motor has answered [s].
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._reader = PacketReader()
        self.heard_at = time.perf_counter()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def read(self, motor: int, register: Register) -> int:
        """Return the value of ``register``. Raises SilentMotorError after some tries."""
        packet = self._packet(read_request(motor, register), register.size)
        return register.decoded(packet.parameters)

    def write(self, motor: int, register: Register, value: int) -> None:
        """Set ``register`` to ``value``. Raises SilentMotorError after some tries."""
        self._packet(write_request(motor, register, value), 0)

    def errors(self, motor: int) -> MotorError:
        """Return the errors that ``motor`` reports. Raises SilentMotorError after some tries."""
        return MotorError(self._packet(ping_request(motor), 0).code)

    def blocks(self, motors: tuple[int, ...], address: int, size: int) -> dict[int, Packet]:
        """Return the ``size`` bytes from ``address`` on of those of ``motors`` that answer."""
        return self._exchange(sync_read_request(motors, address, size), motors, size)

    def scan(self, motors: Iterable[int]) -> tuple[int, ...]:
        """Return which of the ids ``motors`` have a motor that answers."""
        return tuple(motor for motor in motors if any(self._ping(motor) for _ in range(TRIES)))

    def _ping(self, motor: int) -> bool:
        return bool(self._exchange(ping_request(motor), (motor,), 0, SCAN_DEADLINE))

    def read_all(self, motors: tuple[int, ...], register: Register) -> dict[int, int]:
        """Return the value of ``register`` of all ``motors``.

        Raises SilentMotorError if one does not answer. The request is not repeated, because the
        next one asks for newer values.
        """
        packets = self.blocks(motors, register.address, register.size)
        if missing := [motor for motor in motors if motor not in packets]:
            raise _silent(missing)
        return {motor: register.decoded(packets[motor].parameters) for motor in motors}

    def write_all(self, register: Register, values: Mapping[int, int]) -> None:
        """Set ``register`` to the ``values`` by the ids of the motors, none of which answers."""
        self._port.write(sync_write_request(register, values).encoded, WRITE_TIMEOUT)

    def _packet(self, request: Packet, size: int) -> Packet:
        for _ in range(TRIES):
            packets = self._exchange(request, (request.id,), size)
            if request.id in packets:
                return packets[request.id]
        raise _silent((request.id,))

    def _exchange(
        self, request: Packet, motors: tuple[int, ...], size: int, deadline: float = DEADLINE
    ) -> dict[int, Packet]:
        """Send ``request``; return the answers of ``motors`` with ``size`` bytes, by their ids."""
        self._reader.clear()
        start = time.perf_counter()
        self._port.write(request.encoded, WRITE_TIMEOUT)
        packets: dict[int, Packet] = {}
        while len(packets) < len(motors) and time.perf_counter() < start + deadline:
            for packet in self._reader.feed(self._port.read(READ_TIMEOUT)):
                if packet.id in motors and len(packet.parameters) == size:
                    packets[packet.id] = packet
        if packets:
            self.heard_at = start
        return packets


def _silent(motors: Iterable[int]) -> SilentMotorError:
    names = ", ".join(map(str, motors))
    return SilentMotorError(
        f"These motors do not answer: {names}. Check their power, their cables "
        "and the ids in the calibration file."
    )


def check_calibration(bus: MotorBus, name: str, calibration: MotorCalibration) -> None:
    """Raise InputError if what the motor ``name`` keeps is not its ``calibration``.

    Raises SilentMotorError if the motor does not answer.
    """
    for register, what, value in (
        (HOMING_OFFSET, "homing offset", calibration.homing_offset),
        (MIN_POSITION, "least position", calibration.range_min),
        (MAX_POSITION, "largest position", calibration.range_max),
    ):
        if (present := bus.read(calibration.id, register)) != value:
            raise InputError(
                f"The {what} of {name} is {present} in the motor and {value} in the calibration "
                "file. The file is that of another arm, or the arm was calibrated again. Choose "
                "its newest file."
            )
