"""The joints of an SO-100 or SO-101 and the ticks of its motors, by a calibration of LeRobot."""

from __future__ import annotations

import math

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError
from katana450.extensions.motor_bus.calibration import AXES, MOTORS, Calibration, calibration_of
from katana450.extensions.motor_bus.packets import TURN
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen

ROLL = AXES.index("wrist_roll")


class ServoJoints:
    """Linear map between the ticks of the six motors and the joints; the last one is the jaw.

    The middle of a calibrated range is the middle of the joint in the robot description. The roll
    turns without end, and its middle is zero.

    Attributes:
        calibration: the calibrations by the names of the motors.
        ids: numbers of the motors, in the order of the joints.
        scale: (6,) joint angle per tick, with its sign [rad].
        lower, upper: (6,) limits of the joints [rad].
    """

    def __init__(self, calibration: Calibration, robot: Robot) -> None:
        """Raise InputError for a motor without calibration, ConfigurationError for another arm."""
        arm = robot.require_arm()
        if tuple(arm.chain.names) != AXES or not arm.gripper.moves:
            raise ConfigurationError(
                f"{robot.name} is no SO-100 or SO-101: it needs the joints {', '.join(MOTORS)}. "
                "Use --arm so101, or leave --calibration out."
            )
        motors = [calibration_of(calibration, name) for name in MOTORS]
        self.calibration = calibration
        self.ids = tuple(motor.id for motor in motors)
        self._ends = np.array([(motor.range_min, motor.range_max) for motor in motors]).T
        closed, opened = arm.gripper.closed, arm.gripper.opened
        ticks = float(self._ends[1, -1] - self._ends[0, -1])
        signs = np.array([-1.0 if motor.drive_mode else 1.0 for motor in motors])
        self.scale = signs * np.array([math.tau / TURN] * len(AXES) + [(opened - closed) / ticks])
        self.lower = frozen([*arm.limits.lower, arm.gripper.lower])
        self.upper = frozen([*arm.limits.upper, arm.gripper.upper])
        self._middle = 0.5 * (self.lower + self.upper)
        self._middle[ROLL] = 0.0

    def joints(self, ticks: IntArray) -> FloatArray:
        """Return the joints (6,) [rad] at ``ticks`` (6,)."""
        return frozen(self._middle + (ticks - self._ends.mean(axis=0)) * self.scale)

    def ticks(self, joints: FloatArray) -> IntArray:
        """Return the ticks (6,) at ``joints`` (6,) [rad], inside the calibrated ranges."""
        ticks = self._ends.mean(axis=0) + (joints - self._middle) / self.scale
        return np.asarray(np.clip(np.rint(ticks), *self._ends), np.int64)
