"""Positions of the leader's motors as a posture of the arm, by their calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta

from katana450.errors import InputError
from katana450.extensions.leader.motor_bus import MAX_ID, TURN
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.sdk import answers

MAX_BYTES = 64_000
"""Maximum size of a calibration file."""

Ticks = Annotated[int, Meta(ge=-TURN, le=2 * TURN)]


class MotorCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The calibration of one motor.

    Attributes:
        id: its number on the bus.
        drive_mode: 1 if its angle counts in the other direction.
        homing_offset: actual minus reported position [ticks]; the motor stores it too.
        range_min, range_max: extremes of its reported position [ticks].
    """

    id: Annotated[int, Meta(ge=0, le=MAX_ID)]
    drive_mode: Annotated[int, Meta(ge=0, le=1)]
    homing_offset: Annotated[int, Meta(gt=-TURN // 2, lt=TURN // 2)]
    range_min: Ticks
    range_max: Ticks

    def angle(self, ticks: int) -> float:
        """Return the angle [rad] at the position ``ticks``; 0 is the middle of the range."""
        angle = (ticks - (self.range_min + self.range_max) / 2.0) * 2.0 * math.pi / TURN
        return -angle if self.drive_mode else angle

    def fraction(self, ticks: int) -> float:
        """Return the position ``ticks`` as a fraction of the range, 0 to 1."""
        fraction = (ticks - self.range_min) / (self.range_max - self.range_min)
        fraction = min(max(fraction, 0.0), 1.0)
        return 1.0 - fraction if self.drive_mode else fraction


Calibration = dict[str, MotorCalibration]
"""Calibrations by the names of the motors."""


def read_calibration(path: Path) -> Calibration:
    """Return the calibration in the file ``path``. Raises InputError with what is wrong in it."""
    try:
        with path.open("rb") as file:
            return decoded_calibration(file.read(MAX_BYTES + 1))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except InputError as error:
        raise InputError(
            f"{path} is not a calibration file of LeRobot: {error} LeRobot keeps them in "
            "~/.cache/huggingface/lerobot/calibration/teleoperators."
        ) from error


def decoded_calibration(data: bytes) -> Calibration:
    """Return the calibration in the JSON text ``data``. Raises InputError."""
    if len(data) > MAX_BYTES:
        raise InputError(f"it has more than {MAX_BYTES} bytes.")
    try:
        calibration = msgspec.json.decode(data, type=Calibration)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InputError(f"{error}.") from error
    owners: dict[int, str] = {}
    for name, motor in calibration.items():
        if motor.range_min >= motor.range_max:
            raise InputError(
                f"{name}: range_min {motor.range_min} is not below range_max {motor.range_max}."
            )
        if motor.id in owners:
            raise InputError(f"{name} and {owners[motor.id]} have the same id {motor.id}.")
        owners[motor.id] = name
    return calibration


class AxisSource(NamedTuple):
    """The joint of the leader that one joint of the arm follows.

    Attributes:
        motor: name of the motor in the calibration file.
        sign: 1 if both turn in the same direction, -1 otherwise.
        offset: angle of the arm's joint in the middle of the motor's range [deg].
    """

    motor: str
    sign: int
    offset: float = 0.0


AXES = (
    # The leader's pan turns about its axis downwards, the arm's about its axis upwards.
    AxisSource("shoulder_pan", -1),
    AxisSource("shoulder_lift", 1, -76.0),
    AxisSource("elbow_flex", 1, 73.8),
    AxisSource("wrist_flex", 1, 2.2),
    # The leader's roll turns about its axis backwards, the arm's about its axis forwards.
    AxisSource("wrist_roll", -1),
)
"""The joints of the SO-101 leader."""

GRIPPER = "gripper"
"""Name of the motor of its jaw."""

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

    def __init__(self, calibration: Calibration, arm: answers.Arm) -> None:
        """Take the joints of the leader for those of ``arm``, in their order.

        Raises InputError if a motor is not calibrated or the joints do not correspond.
        """
        if len(AXES) != len(arm.lower) or any(arm.slides):
            raise InputError(
                f"{arm.name} has {len(arm.lower)} joints, {sum(arm.slides)} of which slide. The "
                f"leader has {len(AXES)} that turn, so it cannot drive this arm."
            )
        self._axes = [(_of(calibration, axis.motor), axis) for axis in AXES]
        self._finger: MotorCalibration | None = None
        self.finger_range: tuple[float, float] | None = None
        if arm.gripper is not None:
            self._finger, self.finger_range = _of(calibration, GRIPPER), arm.gripper[:2]
        motors = [motor.id for motor, _ in self._axes]
        self.motors = tuple(motors if self._finger is None else [*motors, self._finger.id])
        self._lower = np.array(arm.lower) + LIMIT_MARGIN
        self._upper = np.array(arm.upper) - LIMIT_MARGIN

    def posture(self, ticks: Mapping[int, int]) -> LeaderPosture:
        """Return the posture at the positions ``ticks``, by the ids of the motors."""
        raw = frozen(
            np.array(
                [
                    axis.sign * motor.angle(ticks[motor.id]) + math.radians(axis.offset)
                    for motor, axis in self._axes
                ]
            )
        )
        q = frozen(np.clip(raw, self._lower, self._upper))
        if self._finger is None or self.finger_range is None:
            return LeaderPosture(raw, q, None)
        closed, opened = self.finger_range
        fraction = self._finger.fraction(ticks[self._finger.id])
        return LeaderPosture(raw, q, closed + fraction * (opened - closed))


def _of(calibration: Calibration, name: str) -> MotorCalibration:
    if name not in calibration:
        raise InputError(
            f"The calibration file has no motor {name}, but {', '.join(calibration) or 'none'}. "
            "Choose the file of this leader."
        )
    return calibration[name]
