"""Positions of the leader's motors as a posture of the arm, by calibration and layout."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
import yaml
from msgspec import Meta

from katana450.errors import InputError
from katana450.extensions.leader.motor_bus import MAX_ID, TURN
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.sdk import answers

MAX_BYTES = 64_000
"""Maximum size of a file that describes a leader."""

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


class AxisSource(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joint of the leader that one joint of the arm follows.

    Attributes:
        motor: name of the motor in the calibration file.
        sign: whether both turn in the same direction.
        offset: angle of the arm's joint in the middle of the motor's range [deg].
    """

    motor: str
    sign: Literal[1, -1] = 1
    offset: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0


class FingerSource(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joint of the leader that the fingers follow.

    Attributes:
        motor: name of the motor in the calibration file.
        reversed: whether the fingers are open at the lower end of its range.
    """

    motor: str
    reversed: bool = False


class Layout(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joints of a leader.

    Attributes:
        axes: one for each joint of the arm.
        gripper: that of the fingers; None for a leader without one.
    """

    axes: Annotated[tuple[AxisSource, ...], Meta(min_length=1)]
    gripper: FingerSource | None = None


SO101 = Layout(
    (
        # The leader's pan turns about its axis downwards, the arm's about its axis upwards.
        AxisSource("shoulder_pan", -1),
        AxisSource("shoulder_lift", 1, -76.0),
        AxisSource("elbow_flex", 1, 73.8),
        AxisSource("wrist_flex", 1, 2.2),
        # The leader's roll turns about its axis backwards, the arm's about its axis forwards.
        AxisSource("wrist_roll", -1),
    ),
    FingerSource("gripper"),
)
"""The SO-101 leader. The page has the same numbers in static/leader/follower.js."""


def read_layout(path: Path) -> Layout:
    """Return the layout in the YAML file ``path``. Raises InputError with what is wrong in it."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise InputError(f"{path} has more than {MAX_BYTES} bytes.")
        return msgspec.convert(yaml.safe_load(data), Layout)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except (msgspec.MsgspecError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} is not the layout of a leader: {error}. docs/leader.md has an example."
        ) from error


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
        self._axes = [(_of(calibration, axis), axis) for axis in layout.axes]
        self._finger: tuple[MotorCalibration, FingerSource] | None = None
        self.finger_range: tuple[float, float] | None = None
        if layout.gripper is not None and arm.gripper is not None:
            self._finger = _of(calibration, layout.gripper), layout.gripper
            self.finger_range = arm.gripper[:2]
        motors = [motor.id for motor, _ in self._axes]
        self.motors = tuple(motors if self._finger is None else [*motors, self._finger[0].id])
        if len(set(self.motors)) < len(self.motors):
            raise InputError("The layout of the leader names a motor twice. Each moves one joint.")
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
