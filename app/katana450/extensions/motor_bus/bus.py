"""Exchanges with servos at one bus, each within a deadline.

The bus is a serial port, or a TCP port that passes all bytes on to one, as ser2net does.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping

from katana450.errors import InputError, KatanaError
from katana450.extensions.device_address import DeviceAddress, Port
from katana450.extensions.motor_bus.calibration import MotorCalibration
from katana450.extensions.motor_bus.packets import (
    BROADCAST,
    Instruction,
    Packet,
    PacketReader,
    Register,
    ServoMake,
)

BAUD = 1_000_000
"""[bit/s] Rate of an STS3215 as delivered, and of a Dynamixel motor that LeRobot has set up."""

PORT = 5567
"""TCP port of a bus, if the address names none."""

DEADLINE = 0.05
"""[s] Timeout for the answers to a request. Adapters for USB hold bytes back for up to 16 ms."""

SCAN_DEADLINE = 0.02
"""[s] The same for an id at which there may be no motor."""

READ_TIMEOUT, WRITE_TIMEOUT = 0.005, 1.0
"""[s] Timeouts of one read, which may return a part of an answer, and of a request."""

REBOOT_TIMEOUT = 2.0
"""[s] Time after which a motor that starts again counts as silent."""

TRIES = 3
"""Number of times that a request is sent before the motor counts as silent."""


class MotorRequestError(KatanaError):
    """A motor does not answer, or refuses what is asked."""


class BusLostError(KatanaError):
    """The port of the bus cannot be opened, or is lost."""


def open_port(address: DeviceAddress, device: str) -> Port:
    """Open the bus at ``address``. ``device``: what is there, for messages. Raises BusLostError."""
    return address.open(BAUD, device, BusLostError, drops_unread=True)


class MotorBus:
    """The motors at one port, asked one request at a time.

    Attributes:
        make: their registers and the framing of their packets.
        heard_at: time of the newest request that a motor has answered [s].
    """

    def __init__(self, port: Port, make: ServoMake) -> None:
        self._port, self.make, self._framing = port, make, make.framing
        self._reader = PacketReader(make.framing)
        self._has_status = make.framing.status is not None
        self.heard_at = time.perf_counter()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def read(self, motor: int, register: Register) -> int:
        """Return the value of ``register``. Raises MotorRequestError after some tries."""
        place = self._framing.words(register.address, register.size)
        packet = self._packet(Packet(motor, Instruction.READ, place), register.size)
        return register.decoded(packet.parameters)

    def write(self, motor: int, register: Register, value: int) -> None:
        """Set ``register`` to ``value``. Raises MotorRequestError after some tries."""
        data = self._framing.words(register.address) + register.encoded(value)
        self._packet(Packet(motor, Instruction.WRITE, data), 0)

    def errors(self, motor: int) -> int:
        """Return the bits of the errors that ``motor`` reports. Raises MotorRequestError."""
        return self.reported(self._packet(Packet(motor, Instruction.PING), None))

    def reported(self, answer: Packet) -> int:
        """Return the bits of the errors of which ``answer`` tells. Raises MotorRequestError."""
        register = self.make.hardware_error
        if register is None:
            return answer.code
        return self.read(answer.id, register) if answer.code & self.make.alert else 0

    def reboot(self, motor: int, motors: tuple[int, ...]) -> None:
        """Let ``motor`` start again, which clears its errors, and wait for it.

        It goes limp, and counts within one turn again. ``motors`` are asked meanwhile, so that
        the bus is not silent. Raises MotorRequestError after REBOOT_TIMEOUT.
        """
        end, register = time.perf_counter() + REBOOT_TIMEOUT, self.make.torque_enable
        self._packet(Packet(motor, Instruction.REBOOT), 0)
        while motor not in self.blocks(motors, register.address, register.size):
            if time.perf_counter() > end:
                raise _silent((motor,))

    def blocks(self, motors: tuple[int, ...], address: int, size: int) -> dict[int, Packet]:
        """Return the ``size`` bytes from ``address`` on of those of ``motors`` that answer."""
        place = self._framing.words(address, size)
        request = Packet(BROADCAST, Instruction.SYNC_READ, place + bytes(motors))
        packets = self._exchange(request, motors, size)
        return {motor: packets[motor] for motor in packets if packets[motor].parameters}

    def scan(self, motors: Iterable[int]) -> tuple[int, ...]:
        """Return which of the ids ``motors`` have a motor that answers."""
        return tuple(motor for motor in motors if any(self._ping(motor) for _ in range(TRIES)))

    def _ping(self, motor: int) -> bool:
        return bool(self._exchange(Packet(motor, Instruction.PING), (motor,), None, SCAN_DEADLINE))

    def read_all(self, motors: tuple[int, ...], register: Register) -> dict[int, int]:
        """Return the value of ``register`` of all ``motors``.

        Raises MotorRequestError if one does not answer. The request is not repeated, because the
        next one asks for newer values.
        """
        packets = self.blocks(motors, register.address, register.size)
        if missing := [motor for motor in motors if motor not in packets]:
            raise _silent(missing)
        return {motor: register.decoded(packets[motor].parameters) for motor in motors}

    def write_all(self, register: Register, values: Mapping[int, int]) -> None:
        """Set ``register`` to the ``values`` by the ids of the motors, none of which answers."""
        rows = (bytes((motor,)) + register.encoded(value) for motor, value in values.items())
        data = self._framing.words(register.address, register.size) + b"".join(rows)
        request = Packet(BROADCAST, Instruction.SYNC_WRITE, data)
        self._port.write(self._framing.encoded(request), WRITE_TIMEOUT)

    def _packet(self, request: Packet, size: int | None) -> Packet:
        for _ in range(TRIES):
            packets = self._exchange(request, (request.id,), size)
            if request.id not in packets:
                continue
            answer = packets[request.id]
            if refusal := answer.code & self.make.refusal:
                raise MotorRequestError(
                    f"Motor {answer.id} refuses a request (error {refusal}). Check its model and "
                    "its limits."
                )
            return answer
        raise _silent((request.id,))

    def _exchange(
        self,
        request: Packet,
        motors: tuple[int, ...],
        size: int | None,
        deadline: float = DEADLINE,
    ) -> dict[int, Packet]:
        """Send ``request``; return the answers of ``motors`` with ``size`` bytes, by their ids.

        None stands for any size.
        """
        self._reader.clear()
        start = time.perf_counter()
        self._port.write(self._framing.encoded(request), WRITE_TIMEOUT)
        packets: dict[int, Packet] = {}
        while len(packets) < len(motors) and time.perf_counter() < start + deadline:
            for packet in self._reader.feed(self._port.read(READ_TIMEOUT)):
                # A refusal has no data.
                whole = size in (None, len(packet.parameters)) or packet.code & self.make.refusal
                if whole and packet.id in motors and packet.status is self._has_status:
                    packets[packet.id] = packet
        if packets:
            self.heard_at = start
        return packets


def _silent(motors: Iterable[int]) -> MotorRequestError:
    names = ", ".join(map(str, motors))
    return MotorRequestError(
        f"These motors do not answer: {names}. Check their power, their cables "
        "and the ids in the calibration file."
    )


def check_calibration(bus: MotorBus, name: str, calibration: MotorCalibration) -> None:
    """Raise InputError if what the motor ``name`` keeps is not its ``calibration``.

    Raises MotorRequestError if the motor does not answer.
    """
    make = bus.make
    rows = [
        (make.homing_offset, "homing offset", calibration.homing_offset),
        (make.min_position, "least position", calibration.range_min),
        (make.max_position, "largest position", calibration.range_max),
    ]
    if make.drive_mode is not None:
        rows.append((make.drive_mode, "drive mode", calibration.drive_mode))
    for register, what, value in rows:
        if (present := bus.read(calibration.id, register)) != value:
            raise InputError(
                f"The {what} of {name} is {present} in the motor and {value} in the calibration "
                "file. The file is that of another arm, or the arm was calibrated again. Choose "
                "its newest file."
            )
