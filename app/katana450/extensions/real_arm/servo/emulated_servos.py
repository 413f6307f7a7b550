"""The emulated motors of an arm: their memory, their motion, and faults for tests."""

from __future__ import annotations

import math
from collections.abc import Iterator

import msgspec
import numpy as np

from katana450.extensions.motor_bus.calibration import MOTORS, MotorCalibration
from katana450.extensions.motor_bus.dynamixel import (
    ACCESS_ERROR,
    CURRENT_POSITION_MODE,
    DYNAMIXEL,
    EXTENDED_POSITION_MODE,
    KEPT_BYTES,
    SHUTDOWN,
)
from katana450.extensions.motor_bus.packets import (
    BROADCAST,
    TURN,
    Instruction,
    Packet,
    PacketReader,
    Register,
)
from katana450.extensions.real_arm.servo.arms import SERVO_ARMS, ServoArm

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

FIRMWARE = 0x0A03

STOPS = ((730, 3410), (900, 3180), (900, 3180), (960, 3140), (0, 4095), (2020, 3330))
"""[ticks] Mechanical range of each motor, counted with the homing offsets below, which a
calibration can change."""

OFFSETS = (-37, 1200, 0, -2047, 15, 2047)
"""[ticks] Homing offset of each motor. Two of a Dynamixel arm begin beyond one turn."""

START = (2070, 1000, 3100, 2600, 2047, 2100)
"""[ticks] The arm is folded."""

SHUTDOWN_ERRORS = 0x34
"""Errors at which a Dynamixel motor goes limp, as delivered: heat, shock, overload."""

REBOOT_TIME = 0.1
"""[s] Time for which a motor that starts again does not answer. Assumed."""


def calibration_of(arm: ServoArm, number: int) -> MotorCalibration:
    """Return the calibration of the motor ``number``, from 0, of an emulated ``arm``."""
    whole = number in arm.whole_turns
    offset, ends = (0, (0, TURN - 1)) if whole else (OFFSETS[number], STOPS[number])
    return MotorCalibration(arm.first_id + number, 0, offset, *ends)


def calibration_text(arm: ServoArm = SERVO_ARMS["so101"]) -> bytes:
    """Return the calibration of an emulated ``arm`` as LeRobot writes it."""
    motors = {name: calibration_of(arm, number) for number, name in enumerate(MOTORS)}
    return msgspec.json.format(msgspec.json.encode(motors), indent=4)


class EmulatedServo:
    """One motor and what hangs on it.

    Attributes:
        place, speed: where it is [ticks], counted with its OFFSETS, and how fast [ticks/s].
        blocked, silent: whether something blocks it, and whether it does not answer.
        fault: bits of the errors that it has. A Dynamixel motor reports them until it is rebooted.
        volts, celsius: its supply [V] and its temperature [degrees C].
        make: its registers.
    """

    def __init__(self, number: int, arm: ServoArm = SERVO_ARMS["so101"]) -> None:
        """Create the motor of that ``number``, from 0, of ``arm``, with its torque off."""
        self.place, self.speed = float(START[number]), 0.0
        self._load = self._unready = 0.0
        self.blocked = self.silent = False
        self.fault = 0
        self.volts, self.celsius = VOLTS, CELSIUS
        calibration = calibration_of(arm, number)
        self.make, self._offset = arm.make, calibration.homing_offset
        self._ends, self._sag, self._shift = STOPS[number], SAG[number], 0
        self._memory = bytearray(256)
        make = self.make
        for register, value in (
            (make.firmware, FIRMWARE % 256**make.firmware.size),
            (make.model, arm.models[number]),
            (make.id, calibration.id),
            (make.min_position, calibration.range_min),
            (make.max_position, calibration.range_max),
            (make.homing_offset, self._offset),
            (make.goal_position, START[number]),
            (make.force_limit, make.full_force),
        ):
            self[register] = value
        if make is DYNAMIXEL:
            self[make.mode] = EXTENDED_POSITION_MODE
            self[SHUTDOWN] = SHUTDOWN_ERRORS
            self.reboot()
            self._unready = 0.0

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
    def answers(self) -> bool:
        """True if it answers."""
        return not self.silent and self._unready <= 0.0

    @property
    def code(self) -> int:
        """The error code of its answers."""
        register = self.make.hardware_error
        if register is None:
            return self.fault
        return self.make.alert if self[register] else 0

    @property
    def counted(self) -> float:
        """Where it is [ticks], counted from its homing offset, or within one turn."""
        homing = self[self.make.homing_offset]
        if self.make is DYNAMIXEL:
            return self.place - self._offset + homing - self._shift
        return (self.place + self._offset - homing) % TURN

    def reboot(self) -> None:
        """Start again: limp, without errors, and counting within one turn."""
        self._unready = REBOOT_TIME
        self._shift = TURN * math.floor((self.place - self._offset) / TURN)
        self[self.make.torque_enable] = 0
        if self.make.hardware_error is not None:
            self[self.make.hardware_error] = 0
        self[self.make.goal_position] = round(self.counted)

    def step(self, dt: float) -> None:
        """Move for ``dt`` [s]."""
        make, (lower, upper) = self.make, self._ends
        self._unready -= dt
        if make.hardware_error is not None and self.fault:
            self[make.hardware_error] |= self.fault
            if self.fault & self[SHUTDOWN]:
                self[make.torque_enable] = 0
        weight = self._sag * math.cos((self.place - 0.5 * (lower + upper)) * math.tau / TURN)
        holds, goal = self[make.torque_enable], self[make.goal_position]
        if self[make.mode] not in (EXTENDED_POSITION_MODE, CURRENT_POSITION_MODE):
            goal = min(max(goal, self[make.min_position]), self[make.max_position])
        behind = goal - self.counted + weight if holds else 0.0
        force = self[make.force_limit] / make.full_force
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
        make, counted = self.make, round(self.counted)
        values = (
            counted if make.counts_turns else counted % TURN,
            self.speed,
            self._load,
            self.volts,
            self.celsius,
        )
        for register, value, unit in zip(make.measured, values, make.units, strict=True):
            self[register] = round(value / unit)


class EmulatedServos:
    """The six motors at one bus.

    Attributes:
        motors: the motors, from the base to the jaw.
        lost: fraction of the answers that lose a byte.
    """

    def __init__(self, arm: ServoArm = SERVO_ARMS["so101"]) -> None:
        """Create an ``arm`` that is folded, with its motors off."""
        self.motors = tuple(EmulatedServo(number, arm) for number in range(len(MOTORS)))
        self.lost = 0.0
        self._make, self._framing = arm.make, arm.make.framing
        self._reader = PacketReader(self._framing)
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
                reply = self._framing.encoded(answer)
                if self._random.random() < self.lost:
                    cut = int(self._random.integers(len(reply)))
                    reply = reply[:cut] + reply[cut + 1 :]
                yield reply

    def _answers(self, request: Packet) -> Iterator[Packet]:
        make, word, data = self._make, self._framing.word, request.parameters
        first, second = (int.from_bytes(data[k : k + word], "little") for k in (0, word))
        rest = data[2 * word :]
        if request.code == Instruction.SYNC_WRITE:
            for place in range(0, len(rest) - second, second + 1):
                for motor in self._named(rest[place]):
                    motor.write(first, rest[place + 1 :][:second])
            return
        ids = rest if request.code == Instruction.SYNC_READ else (request.id,)
        for motor in self._named(*ids):
            values, refusal = b"", 0
            match request.code:
                case Instruction.READ | Instruction.SYNC_READ:
                    values = motor.read(first, second)
                case Instruction.WRITE if first < KEPT_BYTES and motor[make.torque_enable]:
                    refusal = ACCESS_ERROR & make.refusal
                case Instruction.PING if make is DYNAMIXEL:
                    values = motor.read(make.model.address, 2) + motor.read(
                        make.firmware.address, 1
                    )
            yield Packet(motor[make.id], motor.code | refusal, values, status=True)
            if request.code == Instruction.WRITE and not refusal:
                motor.write(first, data[word:])
            elif request.code == Instruction.REBOOT:
                motor.reboot()

    def _named(self, *ids: int) -> list[EmulatedServo]:
        """Return the motors that answer and have one of the ``ids``."""
        return [
            motor
            for motor in self.motors
            if motor.answers and {motor[self._make.id], BROADCAST} & {*ids}
        ]
