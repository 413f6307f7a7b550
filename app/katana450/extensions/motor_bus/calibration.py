"""Calibration files of LeRobot: the ranges of motors, by which their positions are angles."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from katana450.errors import InputError
from katana450.extensions.motor_bus.packets import MAX_ID, TURN

AXES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
"""Names of the motors of the joints of every arm here in its calibration, and of the joints of an
SO-101 in its description."""

GRIPPER = "gripper"
"""Name of the motor of the jaw, and of the joint of that."""

MOTORS = (*AXES, GRIPPER)
"""Names of all motors."""

MAX_BYTES = 64_000
"""Maximum size of a calibration file."""

Ticks = Annotated[int, Meta(ge=-TURN, le=2 * TURN)]


class MotorCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The calibration of one motor.

    Attributes:
        id: its number on the bus.
        drive_mode: its lowest bit is 1 if the angle counts in the other direction. A Dynamixel
            motor keeps it, with further bits, and turns its positions around itself.
        homing_offset: offset of its zero [ticks]; the motor stores it too.
        range_min, range_max: extremes of its reported position [ticks].
    """

    id: Annotated[int, Meta(ge=0, le=MAX_ID)]
    drive_mode: Annotated[int, Meta(ge=0, le=15)]
    homing_offset: int
    range_min: Ticks
    range_max: Ticks

    @property
    def reverses(self) -> bool:
        """True if the drive mode turns the angle around."""
        return bool(self.drive_mode & 1)

    def angle(self, ticks: int) -> float:
        """Return the angle [rad] at the position ``ticks``; 0 is the middle of the range."""
        angle = (ticks - (self.range_min + self.range_max) / 2.0) * 2.0 * math.pi / TURN
        return -angle if self.reverses else angle

    def fraction(self, ticks: int) -> float:
        """Return the position ``ticks`` as a fraction of the range, 0 to 1."""
        fraction = (ticks - self.range_min) / (self.range_max - self.range_min)
        fraction = min(max(fraction, 0.0), 1.0)
        return 1.0 - fraction if self.reverses else fraction


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
            "~/.cache/huggingface/lerobot/calibration."
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


def calibration_of(calibration: Calibration, name: str) -> MotorCalibration:
    """Return the calibration of the motor ``name``. Raises InputError if there is none."""
    if name not in calibration:
        raise InputError(
            f"The calibration file has no motor {name}, but {', '.join(calibration) or 'none'}. "
            "Choose the file of this arm."
        )
    return calibration[name]
