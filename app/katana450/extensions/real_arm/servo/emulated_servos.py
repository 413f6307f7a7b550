"""The emulated motors of an SO-101: their memory, their motion, and faults for tests."""

from __future__ import annotations

import math
from collections.abc import Iterator

import msgspec
import numpy as np

from katana450.extensions.motor_bus import packets as reg
from katana450.extensions.motor_bus.calibration import MOTORS, MotorCalibration
from katana450.extensions.motor_bus.packets import Instruction, MotorError, Packet, Register

STEP = 0.002
"""[s] Longest step."""

MAX_SPEED, MAX_ACCELERATION = 3000.0, 40_000.0
"""[ticks/s], [ticks/s^2] Of a motor without load. Assumed."""

GAIN = 25.0
"""[1/s] Speed per distance from the goal. Assumed; the lag is its inverse."""

STALL_ERROR = 60.0
"""[ticks] Distance from the goal at which a motor pushes with its whole force. Assumed."""

SAG = (0.0, 25.0, 20.0, 8.0, 0.0, 0.0)
"""[ticks] By which each motor stays below its goal in the middle of its range. Assumed."""

FALL = 600.0
"""[ticks/s] Speed of a limp joint that carries weight."""

VOLTS, CELSIUS = 7.4, 30.0

MODEL_STS3215, FIRMWARE_3_10 = 777, 0x0A03

# Counted with the homing offsets below, which a calibration can change.
RANGES = ((730, 3410), (900, 3180), (900, 3180), (960, 3140), (0, 4095), (2020, 3330))
"""[ticks] Mechanical range of each motor."""

OFFSETS = (-37, 1200, 0, -2047, 15, 2047)
"""[ticks] Homing offset of each motor."""

START = (2070, 1000, 3100, 2600, 2047, 2100)
"""[ticks] The arm is folded."""


def calibration_text() -> bytes:
    """Return the calibration of the emulated arm as LeRobot writes it."""
    motors = {
        name: MotorCalibration(number, 0, offset, *ends)
        for number, (name, offset, ends) in enumerate(
            zip(MOTORS, OFFSETS, RANGES, strict=True), start=1
        )
    }
    return msgspec.json.format(msgspec.json.encode(motors), indent=4)


class EmulatedServo:
    """One motor and what hangs on it.

    Attributes:
        place, speed: where it is [ticks], counted with its OFFSETS, and how fast [ticks/s].
        blocked, silent: whether something blocks it, and whether it does not answer.
        fault: errors that it reports.
        volts, celsius: its supply [V] and its temperature [degrees C].
    """

    def __init__(self, number: int) -> None:
        """Create the motor of that ``number``, from 0, with its torque off."""
        self.place, self.speed = float(START[number]), 0.0
        self._load = 0.0
        self.blocked = self.silent = False
        self.fault = MotorError(0)
        self.volts, self.celsius = VOLTS, CELSIUS
        self._ends, self._sag, self._offset = RANGES[number], SAG[number], OFFSETS[number]
        self._memory = bytearray(128)
        for register, value in (
            (reg.FIRMWARE, FIRMWARE_3_10),
            (reg.MODEL, MODEL_STS3215),
            (reg.ID, number + 1),
            (reg.MIN_POSITION, self._ends[0]),
            (reg.MAX_POSITION, self._ends[1]),
            (reg.HOMING_OFFSET, OFFSETS[number]),
            (reg.GOAL_POSITION, START[number]),
            (reg.TORQUE_LIMIT, 1000),
            (reg.LOCK, 1),
        ):
            self[register] = value

    def __getitem__(self, register: Register) -> int:
        """Return the value of ``register``."""
        return register.decoded(self.read(register.address, register.size))

    def __setitem__(self, register: Register, value: int) -> None:
        """Set ``register`` to ``value``."""
        self.write(register.address, register.encoded(value))

    def read(self, address: int, size: int) -> bytes:
        """Return ``size`` bytes of the memory from ``address`` on."""
        return bytes(self._memory[address : address + size])

    def write(self, address: int, data: bytes) -> None:
        """Write ``data`` into the memory from ``address`` on."""
        self._memory[address : address + len(data)] = data[: max(len(self._memory) - address, 0)]

    @property
    def counted(self) -> float:
        """Where it is [ticks], counted from its homing offset within one turn."""
        return (self.place + self._offset - self[reg.HOMING_OFFSET]) % reg.TURN

    def step(self, dt: float) -> None:
        """Move for ``dt`` [s]."""
        lower, upper = self._ends
        weight = self._sag * math.cos((self.place - 0.5 * (lower + upper)) * math.tau / reg.TURN)
        holds = self[reg.TORQUE_ENABLE]
        goal = min(max(self[reg.GOAL_POSITION], self[reg.MIN_POSITION]), self[reg.MAX_POSITION])
        behind = goal - self.counted + weight if holds else 0.0
        force = self[reg.TORQUE_LIMIT] / 1000.0
        load = min(max(behind / STALL_ERROR, -force), force)
        wanted = GAIN * behind if holds else FALL * weight / max(SAG)
        wanted = min(max(wanted, -MAX_SPEED), MAX_SPEED)
        change = MAX_ACCELERATION * dt
        self.speed += min(max(wanted - self.speed, -change), change)
        place = min(max(self.place + self.speed * dt, lower), upper)
        if self.blocked or place == self.place:
            self.speed, place = 0.0, self.place
        self.place = place
        self._load = load

    def publish(self) -> None:
        """Write what was measured into the memory."""
        for register, value in (
            (reg.PRESENT_POSITION, round(self.counted) % reg.TURN),
            (reg.PRESENT_SPEED, self.speed),
            (reg.PRESENT_LOAD, 1000.0 * self._load),
            (reg.PRESENT_VOLTAGE, 10.0 * self.volts),
            (reg.PRESENT_TEMPERATURE, self.celsius),
        ):
            self[register] = round(value)


class EmulatedServos:
    """The six motors at one bus.

    Attributes:
        motors: the motors, from the base to the jaw.
        lost: fraction of the answers that lose a byte.
    """

    def __init__(self) -> None:
        """Create an arm that is folded, with its motors off."""
        self.motors = tuple(map(EmulatedServo, range(len(MOTORS))))
        self.lost = 0.0
        self._reader = reg.PacketReader()
        self._random = np.random.default_rng(1)
        self.step(STEP)

    def step(self, seconds: float) -> None:
        """Move for ``seconds``."""
        count = max(math.ceil(seconds / STEP), 1)
        for motor in self.motors:
            for _ in range(count):
                motor.step(seconds / count)
            motor.publish()

    def replies(self, data: bytes) -> Iterator[bytes]:
        """Yield the answers to the requests that ``data`` completes."""
        for request in self._reader.feed(data):
            for answer in self._answers(request):
                reply = answer.encoded
                if self._random.random() < self.lost:
                    cut = int(self._random.integers(len(reply)))
                    reply = reply[:cut] + reply[cut + 1 :]
                yield reply

    def _answers(self, request: Packet) -> Iterator[Packet]:
        data = request.parameters
        match request.code:
            case Instruction.SYNC_READ if len(data) > 2:
                for motor in self._named(*data[2:]):
                    yield self._answer(motor, motor.read(data[0], data[1]))
            case Instruction.SYNC_WRITE if len(data) > 2:
                for place in range(2, len(data) - data[1], data[1] + 1):
                    for motor in self._named(data[place]):
                        motor.write(data[0], data[place + 1 : place + 1 + data[1]])
            case Instruction.READ if len(data) == 2:
                for motor in self._named(request.id):
                    yield self._answer(motor, motor.read(data[0], data[1]))
            case Instruction.WRITE if data:
                for motor in self._named(request.id):
                    yield self._answer(motor)
                    motor.write(data[0], data[1:])
            case Instruction.PING:
                yield from map(self._answer, self._named(request.id))

    def _named(self, *ids: int) -> list[EmulatedServo]:
        """Return the motors that answer and have one of the ``ids``."""
        return [
            motor
            for motor in self.motors
            if not motor.silent and {motor[reg.ID], reg.BROADCAST} & {*ids}
        ]

    def _answer(self, motor: EmulatedServo, data: bytes = b"") -> Packet:
        return Packet(motor[reg.ID], int(motor.fault), data)
