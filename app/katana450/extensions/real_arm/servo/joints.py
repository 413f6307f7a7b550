"""The joints of an arm of bus servos and the ticks of its motors, by a calibration of LeRobot."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError
from katana450.extensions.motor_bus.calibration import AXES, MOTORS, Calibration, calibration_of
from katana450.extensions.motor_bus.packets import TURN
from katana450.extensions.real_arm.servo.arms import SERVO_ARMS, ServoArm
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen

ROLL = AXES.index("wrist_roll")


class ServoJoints:
    """Linear map between the ticks of the six motors and the joints; the last one is the jaw.

    The middle of a calibrated range is the middle of the joint in the robot description. The middle
    of a range of a whole turn, and of the roll, is zero.

    Attributes:
        arm: the kind of arm.
        calibration: the calibrations by the names of the motors.
        ids: numbers of the motors, in the order of the joints.
        scale: (6,) joint angle per tick, with its sign [rad; m for a jaw that slides].
        lower, upper: (6,) limits of the joints [rad].
    """

    def __init__(
        self,
        calibration: Calibration,
        robot: Robot,
        arm: ServoArm = SERVO_ARMS["so101"],
        reversed_motors: Collection[str] = (),
    ) -> None:
        """Take the joints of ``robot`` for the motors, in their order.

        ``reversed_motors``: names of those that turn against the joints of the description.

        Raises InputError for a motor without calibration, ConfigurationError for another robot.
        """
        model = robot.require_arm()
        names = tuple(model.chain.names)
        is_so101 = arm is SERVO_ARMS["so101"]
        if len(names) != len(AXES) or not model.gripper.moves or (is_so101 and names != AXES):
            needs = f"the joints {', '.join(MOTORS)}" if is_so101 else "five joints and a gripper"
            raise ConfigurationError(
                f"{robot.name} is not {arm.name}: it needs {needs}. "
                "Use another --arm, name another --driver, or leave --calibration out."
            )
        if unknown := ", ".join(sorted({*reversed_motors} - {*MOTORS})):
            raise ConfigurationError(f"No motor is called {unknown}, but {', '.join(MOTORS)}.")
        motors = [calibration_of(calibration, name) for name in MOTORS]
        self.arm, self.calibration = arm, calibration
        self.ids = tuple(motor.id for motor in motors)
        self._ends = np.array([(motor.range_min, motor.range_max) for motor in motors]).T
        spans = self._ends[1] - self._ends[0]
        whole = spans >= TURN - 1
        closed, opened = model.gripper.closed, model.gripper.opened
        if whole[-1] and model.gripper.slides:
            raise ConfigurationError(
                "The gripper was calibrated for a whole turn, and its fingers slide. Calibrate it "
                "by moving it to both of its ends."
            )
        reverses = [
            (arm.make.drive_mode is None and motor.reverses) != (name in reversed_motors)
            for name, motor in zip(MOTORS, motors, strict=True)
        ]
        jaw = math.tau / TURN if whole[-1] else (opened - closed) / float(spans[-1])
        self.scale = np.where(reverses, -1.0, 1.0) * ([math.tau / TURN] * len(AXES) + [jaw])
        self.lower = frozen([*model.limits.lower, model.gripper.lower])
        self.upper = frozen([*model.limits.upper, model.gripper.upper])
        self._middle = np.where(whole, 0.0, 0.5 * (self.lower + self.upper))
        self._middle[ROLL] = 0.0

    def turns(self, ticks: IntArray) -> IntArray:
        """Return the ticks (6,) of the whole turns by which ``ticks`` (6,) leave the ranges."""
        if not self.arm.make.counts_turns:
            return np.zeros_like(ticks)
        turns = np.rint((ticks - self._ends.mean(axis=0)) / TURN)
        return np.asarray(TURN * turns, np.int64)

    def joints(self, ticks: IntArray) -> FloatArray:
        """Return the joints (6,) [rad] at ``ticks`` (6,)."""
        return frozen(self._middle + (ticks - self._ends.mean(axis=0)) * self.scale)

    def ticks(self, joints: FloatArray) -> IntArray:
        """Return the ticks (6,) at ``joints`` (6,) [rad], inside the calibrated ranges."""
        ticks = self._ends.mean(axis=0) + (joints - self._middle) / self.scale
        return np.asarray(np.clip(np.rint(ticks), *self._ends), np.int64)
