"""Positions of the leader's motors as a posture of the arm."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from katana450.errors import InputError
from katana450.extensions.leader.calibration import Calibration, MotorCalibration
from katana450.extensions.leader.layout import AxisSource, FingerSource, Layout
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.sdk import answers

LIMIT_MARGIN = 1e-4
"""[rad] Distance that is kept from the limits of the joints, so that no rounding exceeds them."""


@dataclass(frozen=True, eq=False)
class LeaderPosture:
    """The posture of the leader in the joints of the arm.

    Attributes:
        raw: (n,) joint angles without limits [rad].
        q: (n,) the same within the limits of the arm [rad].
        finger: finger joint [rad, or m for fingers that slide]; None without one on both sides.
    """

    raw: FloatArray
    q: FloatArray
    finger: float | None


class JointMap:
    """The relation between the motors of a leader and the joints of an arm.

    Attributes:
        motors: ids of the motors that it uses.
        finger_range: finger joint closed and open; None without one on both sides.
    """

    def __init__(self, calibration: Calibration, layout: Layout, arm: answers.Arm) -> None:
        """Take the joints of ``layout`` for those of ``arm``, in their order.

        Raises InputError if a motor is not calibrated or the joints do not correspond.
        """
        if len(layout.axes) != len(arm.lower) or any(arm.slides):
            raise InputError(
                f"{arm.name} has {len(arm.lower)} joints, {sum(arm.slides)} of which slide. The "
                f"layout of the leader names {len(layout.axes)} that turn. Give another one by "
                "--layout."
            )
        self._axes = [(_of(calibration, each), each) for each in layout.axes]
        self._finger: tuple[MotorCalibration, FingerSource] | None = None
        self.finger_range: tuple[float, float] | None = None
        if layout.gripper is not None and arm.gripper is not None:
            self._finger = _of(calibration, layout.gripper), layout.gripper
            self.finger_range = arm.gripper[:2]
        found = [motor.id for motor, _ in self._axes]
        self.motors = tuple(found if self._finger is None else [*found, self._finger[0].id])
        if len(set(self.motors)) < len(self.motors):
            raise InputError("The layout of the leader names a motor twice. Each moves one joint.")
        self._lower = np.array(arm.lower) + LIMIT_MARGIN
        self._upper = np.array(arm.upper) - LIMIT_MARGIN

    def posture(self, ticks: Mapping[int, int]) -> LeaderPosture:
        """Return the posture at the positions ``ticks``, by the ids of the motors."""
        raw = frozen(
            np.array(
                [
                    each.sign * motor.angle(ticks[motor.id]) + math.radians(each.offset)
                    for motor, each in self._axes
                ]
            )
        )
        q = frozen(np.clip(raw, self._lower, self._upper))
        if self._finger is None or self.finger_range is None:
            return LeaderPosture(raw, q, None)
        motor, source = self._finger
        fraction = motor.fraction(ticks[motor.id])
        closed, opened = self.finger_range
        fraction = 1.0 - fraction if source.reversed else fraction
        return LeaderPosture(raw, q, closed + fraction * (opened - closed))


def _of(calibration: Calibration, source: AxisSource | FingerSource) -> MotorCalibration:
    try:
        return calibration[source.motor]
    except KeyError as error:
        raise InputError(
            f"The calibration file has no motor {source.motor}, but "
            f"{', '.join(calibration) or 'none'}. Choose the file of this leader, or give its "
            "joints by --layout."
        ) from error
