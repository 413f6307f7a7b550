"""The driver of an arm of bus servos: a thread of its own exchanges packets with its motors."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct
from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError, InputError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.motor_bus.bus import (
    PORT,
    BusLostError,
    MotorBus,
    MotorRequestError,
    check_calibration,
    open_port,
)
from katana450.extensions.motor_bus.calibration import GRIPPER, MOTORS, read_calibration
from katana450.extensions.real_arm.driver_thread import SHORTEST_RETRY, DriverThread
from katana450.extensions.real_arm.servo.arms import SERVO_ARMS
from katana450.extensions.real_arm.servo.joints import ServoJoints
from katana450.extensions.real_arm.servo.machine import SILENT_TIME, Readings, ServoMachine
from katana450.extensions.real_arm.tool_travel import Travel, tool_travel
from katana450.extras import require
from katana450.maths.geometry.arrays import FloatArray

PERIOD = 0.01
"""[s] Time between two exchanges of goals and readings."""

TORQUE_PERIOD = 0.25
"""[s] Time between two questions whether the motors still hold the arm."""


class ServoDriver(DriverThread[ServoMachine, MotorBus]):
    """An arm of bus servos behind the protocol of drivers."""

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
        self._turns = np.zeros(len(MOTORS), np.int64)
        registers = self._joints.arm.make.measured
        self._start = min(register.address for register in registers)
        self._size = max(register.address + register.size for register in registers) - self._start

    def _open(self) -> MotorBus:
        """Return the bus, on which are the motors of the calibration. Raises KatanaError."""
        bus = MotorBus(open_port(self._port, "the arm"), self._joints.arm.make)
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
            raise MotorRequestError(f"No answer of {names}.{hint} Check power and cables.")
        for name, motor in zip(MOTORS, joints.ids, strict=True):
            check_calibration(bus, name, joints.calibration[name])
            if (mode := bus.read(motor, bus.make.mode)) not in bus.make.modes:
                raise InputError(
                    f"{name} is in operating mode {mode}, in which it holds no position. Run "
                    "`lerobot-calibrate`, which sets it."
                )

    def _work(self, link: MotorBus, now: float) -> float:
        """Send the goals and read the motors, at once for a stop."""
        machine = self._machine
        if now < self._due and not machine.hurries and not machine.acts:
            return self._due - now
        self._due = max(self._due + PERIOD, now)
        if goals := machine.goals():
            turns = dict(zip(self._joints.ids, self._turns.tolist(), strict=True))
            raw = {motor: goal + turns[motor] for motor, goal in goals.items()}
            link.write_all(link.make.goal_position, raw)
        try:
            self._read(link)
            if machine.acts:
                self._perform(link, machine.acts.popleft())
            elif machine.mode.follows and now >= self._torque_due:
                self._torque_due = now + TORQUE_PERIOD
                self._check_torque(link)
        except MotorRequestError as error:
            machine.fail(str(error))
        return 0.0

    def _read(self, bus: MotorBus) -> None:
        ids, start, make = self._joints.ids, self._clock(), bus.make
        packets = bus.blocks(ids, self._start, self._size)
        now = self._clock()
        if len(packets) == len(ids):
            self._retry, self._machine.round_trip = SHORTEST_RETRY, now - start
            answers = [packets[motor] for motor in ids]
            rows = [
                [register.in_block(answer.parameters, self._start) for register in make.measured]
                for answer in answers
            ]
            ticks, speeds, loads, volts, celsius = (np.array(rows) * make.units).T
            errors = tuple(map(bus.reported, answers))
            t, places = 0.5 * (start + now), ticks.astype(np.int64)
            if not self._machine.mode.follows:
                # A motor that was reset counts within one turn again.
                self._turns = self._joints.turns(places)
            places -= self._turns
            self._machine.measured(Readings(t, places, speeds, loads, volts, celsius, errors))
        elif packets:
            self._machine.silent([motor for motor in ids if motor not in packets], now)
        elif now - bus.heard_at > 3.0 * SILENT_TIME:
            raise BusLostError("No motor answers. Check the power supply and the cable.")

    def _perform(self, bus: MotorBus, act: ArmAct) -> None:
        """Let the motors hold the arm where it is, or switch them off."""
        ids, machine, make = self._joints.ids, self._machine, bus.make
        if act is ArmAct.RELEASE:
            for motor in ids:
                bus.write(motor, make.torque_enable, 0)
            machine.released()
            return
        for motor in ids:
            if make.hardware_error is not None and bus.read(motor, make.hardware_error):
                bus.reboot(motor, ids)
        places = [bus.read(motor, make.position) for motor in ids]
        for name, motor, place in zip(MOTORS, ids, places, strict=True):
            for register, value in make.jaw_settings if name == GRIPPER else make.settings:
                bus.write(motor, register, value)
            bus.write(motor, make.goal_position, place)
            bus.write(motor, make.torque_enable, 1)
        self._turns = self._joints.turns(np.array(places))
        machine.engaged(self._clock(), np.array(places) - self._turns)

    def _check_torque(self, bus: MotorBus) -> None:
        register = bus.make.torque_enable
        blocks = bus.blocks(self._joints.ids, register.address, register.size)
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
    arm = SERVO_ARMS[options.driver or "so101"]
    if options.calibration is None:
        name = arm.name[0].upper() + arm.name[1:]
        raise ConfigurationError(f"{name} needs --calibration FILE, that of LeRobot.")
    if options.arm_log is not None:
        raise ConfigurationError("--arm-log is for a Katana450 alone.")
    calibration = read_calibration(options.calibration)
    joints = ServoJoints(calibration, robot, arm, options.reversed)
    return ServoDriver(address, joints, np.array([*q, gripper]), tool_travel(robot))
