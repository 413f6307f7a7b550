"""The driver of an SO-100 or SO-101: a thread of its own exchanges packets with its motors."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct
from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.motor_bus import packets as reg
from katana450.extensions.motor_bus.bus import (
    PORT,
    BusLostError,
    MotorBus,
    SilentMotorError,
    check_calibration,
    open_port,
)
from katana450.extensions.motor_bus.calibration import GRIPPER, MOTORS, read_calibration
from katana450.extensions.real_arm.driver_thread import SHORTEST_RETRY, DriverThread
from katana450.extensions.real_arm.servo.joints import ServoJoints
from katana450.extensions.real_arm.servo.machine import SILENT_TIME, Readings, ServoMachine
from katana450.extensions.real_arm.tool_travel import Travel, tool_travel
from katana450.extras import require
from katana450.maths.geometry.arrays import FloatArray

PERIOD = 0.01
"""[s] Time between two exchanges of goals and readings."""

TORQUE_PERIOD = 0.25
"""[s] Time between two questions whether the motors still hold the arm."""

BLOCK = (
    reg.PRESENT_POSITION,
    reg.PRESENT_SPEED,
    reg.PRESENT_LOAD,
    reg.PRESENT_VOLTAGE,
    reg.PRESENT_TEMPERATURE,
)
"""Registers that follow one another and are read at once."""

START = BLOCK[0].address
SIZE = sum(register.size for register in BLOCK)

UNITS = np.array((1.0, 1.0, 1e-3, 0.1, 1.0))
"""Units of these registers: ticks, ticks/s, fraction of the torque, V, degrees C."""

JAW_LIMIT, FULL_LIMIT = 500, 1000
"""[1/1000] The jaw presses with half of its force, as LeRobot lets it."""

ACCELERATION = 254
"""[100 ticks/s^2] The largest value: the setpoints are smooth."""


class ServoDriver(DriverThread[ServoMachine, MotorBus]):
    """An SO-100 or SO-101 behind the protocol of drivers."""

    def __init__(
        self,
        address: DeviceAddress,
        joints: ServoJoints,
        start: FloatArray,
        travel: Travel | None = None,
    ) -> None:
        """Create the driver of the arm at ``address`` without a connection.

        joints: its motors. start: (6,) joints that are reported before the first reading [rad].
        travel: travel of the tool between two postures; None if a stop is measured without it.
        """
        super().__init__(ServoMachine(joints, start, travel), str(address))
        self._port, self._joints = address, joints
        self._due = self._torque_due = 0.0

    def _open(self) -> MotorBus:
        """Return the bus, on which are the motors of the calibration. Raises KatanaError."""
        bus = MotorBus(open_port(self._port, "the arm"))
        try:
            self._identify(bus)
        except Exception:
            bus.close()
            raise
        return bus

    def _identify(self, bus: MotorBus) -> None:
        joints = self._joints
        missing = set(joints.ids) - set(bus.scan(joints.ids))
        if missing:
            others = bus.scan(set(range(1, 21)) - set(joints.ids)) if len(missing) < 6 else ()
            names = ", ".join(self._machine.name(motor) for motor in sorted(missing))
            hint = f" A motor answers as id {others[0]}: give it its own id." if others else ""
            raise SilentMotorError(f"No answer of {names}.{hint} Check power and cables.")
        for name in MOTORS:
            check_calibration(bus, name, joints.calibration[name])

    def _work(self, link: MotorBus, now: float) -> float:
        """Send the goals and read the motors, at once for a stop."""
        machine = self._machine
        if now < self._due and not machine.hurries and not machine.acts:
            return self._due - now
        self._due = max(self._due + PERIOD, now)
        if goals := machine.goals():
            link.write_all(reg.GOAL_POSITION, goals)
        self._read(link)
        try:
            if machine.acts:
                self._perform(link, machine.acts.popleft())
            elif machine.mode.follows and now >= self._torque_due:
                self._torque_due = now + TORQUE_PERIOD
                self._check_torque(link)
        except SilentMotorError as error:
            machine.fail(str(error))
        return 0.0

    def _read(self, bus: MotorBus) -> None:
        ids, start = self._joints.ids, self._clock()
        packets = bus.blocks(ids, START, SIZE)
        now = self._clock()
        if len(packets) == len(ids):
            self._retry, self._machine.round_trip = SHORTEST_RETRY, now - start
            answers = [packets[motor] for motor in ids]
            rows = [
                [r.decoded(answer.parameters[r.address - START :][: r.size]) for r in BLOCK]
                for answer in answers
            ]
            ticks, speeds, loads, volts, celsius = (np.array(rows) * UNITS).T
            errors = tuple(reg.MotorError(answer.code) for answer in answers)
            t, places = 0.5 * (start + now), ticks.astype(np.int64)
            self._machine.measured(Readings(t, places, speeds, loads, volts, celsius, errors))
        elif packets:
            self._machine.silent([motor for motor in ids if motor not in packets], now)
        elif now - bus.heard_at > 3.0 * SILENT_TIME:
            raise BusLostError("No motor answers. Check the power supply and the cable.")

    def _perform(self, bus: MotorBus, act: ArmAct) -> None:
        """Let the motors hold the arm where it is, or switch them off."""
        joints, machine = self._joints, self._machine
        if act is ArmAct.RELEASE:
            for motor in joints.ids:
                bus.write(motor, reg.TORQUE_ENABLE, 0)
            machine.released()
            return
        places = {motor: bus.read(motor, reg.PRESENT_POSITION) for motor in joints.ids}
        for name, motor in zip(MOTORS, joints.ids, strict=True):
            bus.write(motor, reg.TORQUE_LIMIT, JAW_LIMIT if name == GRIPPER else FULL_LIMIT)
            bus.write(motor, reg.ACCELERATION, ACCELERATION)
            bus.write(motor, reg.GOAL_POSITION, places[motor])
            bus.write(motor, reg.TORQUE_ENABLE, 1)
        machine.engaged(self._clock())

    def _check_torque(self, bus: MotorBus) -> None:
        blocks = bus.blocks(self._joints.ids, reg.TORQUE_ENABLE.address, reg.TORQUE_ENABLE.size)
        limp = [motor for motor, packet in blocks.items() if not packet.parameters[0]]
        if limp:
            name = self._machine.name(limp[0])
            text = f"{name} is limp: it was reset, or protects itself. Support the arm, then"
            self._machine.fail(f"{text} unblock it.", limp)


def driver_of(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> ServoDriver:
    """Return the driver of the arm at ``options.device``, without a connection.

    q: (5,) [rad] and gripper [rad] are reported before the first reading. Raises KatanaError for a
    wrong address, a missing extra, a wrong calibration and a robot that is not such an arm.
    """
    address = DeviceAddress.parse(options.device, PORT)
    if address.port is None:
        require("serial", "serial", "Serial ports")
    if options.calibration is None:
        raise ConfigurationError("An SO-100 or SO-101 needs --calibration FILE, that of LeRobot.")
    if options.arm_log is not None:
        raise ConfigurationError("--arm-log is for a Katana450 alone.")
    joints = ServoJoints(read_calibration(options.calibration), robot)
    return ServoDriver(address, joints, np.array([*q, gripper]), tool_travel(robot))
