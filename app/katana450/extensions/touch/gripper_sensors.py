"""The 16 sensors in the fingers of the real gripper, as the controller sends them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

from katana450.errors import InputError

COUNT = 16
"""Number of values in an answer."""

MAX_VALUE = 255
"""Greatest value: the sensors are read with 8 bits."""

HELD_VALUE = 140
"""Value of a force sensor that counts as holding: the threshold of the grasp of the Katana at
Bielefeld (`katana_arm_controllers.yaml`)."""

HELD_FORCE = 2.0
"""[N] Force on one half of a pad that is read as HELD_VALUE. Assumed: no scale is published."""

SATURATION_DISTANCE = 15e-3
"""[m] Distance up to which an infrared sensor reads MAX_VALUE. Assumed."""

MAX_DISTANCE = SATURATION_DISTANCE * math.sqrt(2.0 * MAX_VALUE)
"""[m] Distance from which an infrared sensor reads 0."""

RESERVED = (2, 10)
"""Places among the values that stand for no sensor."""


@dataclass(frozen=True)
class GripperSensors:
    """Values of the sensors, each from 0 to 255, in the order in which the controller sends them.

    The order is that of Fawkes (`KatanaInterface`) and of the configuration of Bielefeld, which
    agree. Infrared sensors measure how much light an object reflects, so the value grows as it
    comes near.

    Attributes:
        right_near_distance: infrared, inner surface of the right finger, next to the palm.
        right_far_distance: infrared, inner surface of the right finger, at the tip.
        conductivity: current between both fingers.
        right_outer_distance: infrared, outer surface of the right finger.
        right_tip_distance: infrared, ahead of the tip of the right finger.
        right_rear_force: force on the half of the right pad next to the palm.
        right_front_force: force on the half of the right pad at the tip.
        left_near_distance: as that of the right finger.
        left_far_distance: as that of the right finger.
        centre_distance: infrared, from the palm ahead.
        left_outer_distance: as that of the right finger.
        left_tip_distance: as that of the right finger.
        left_rear_force: as that of the right finger.
        left_front_force: as that of the right finger.
    """

    right_near_distance: int = 0
    right_far_distance: int = 0
    conductivity: int = 0
    right_outer_distance: int = 0
    right_tip_distance: int = 0
    right_rear_force: int = 0
    right_front_force: int = 0
    left_near_distance: int = 0
    left_far_distance: int = 0
    centre_distance: int = 0
    left_outer_distance: int = 0
    left_tip_distance: int = 0
    left_rear_force: int = 0
    left_front_force: int = 0

    def __post_init__(self) -> None:
        for name, value in self.named().items():
            if type(value) is not int or not 0 <= value <= MAX_VALUE:
                raise InputError(
                    f"{name} must be a whole number from 0 to {MAX_VALUE}, not {value!r}."
                )

    @classmethod
    def from_bytes(cls, values: Sequence[int] | bytes) -> Self:
        """Return the sensors of the 16 values that follow ``E`` in the answer of the controller.

        Raises InputError for another number of values, and for a value out of range.
        """
        if len(values) != COUNT:
            raise InputError(f"The gripper has {COUNT} sensor values, not {len(values)}.")
        return cls(**{name: values[index] for name, index in INDICES.items()})

    def to_bytes(self) -> bytes:
        """Return the 16 values; the reserved ones are 0."""
        values = bytearray(COUNT)
        for name, value in self.named().items():
            values[INDICES[name]] = value
        return bytes(values)

    def named(self) -> dict[str, int]:
        """Return the values by their names."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def holding(self) -> bool:
        """True if both fingers press with HELD_VALUE or more, by the rule of Bielefeld."""
        right = max(self.right_rear_force, self.right_front_force)
        left = max(self.left_rear_force, self.left_front_force)
        return min(right, left) >= HELD_VALUE


INDICES = dict(
    zip(
        (each.name for each in fields(GripperSensors)),
        (place for place in range(COUNT) if place not in RESERVED),
        strict=True,
    )
)
"""Place of each sensor among the values."""


def distance_value(distance: float) -> int:
    """Return the value of an infrared sensor before a surface at ``distance`` [m].

    The light that returns falls with the square of the distance. Below SATURATION_DISTANCE the
    value is the greatest one. The curve of the real sensors is not published, so this is assumed.
    """
    if distance <= SATURATION_DISTANCE:
        return MAX_VALUE
    return round(MAX_VALUE * (SATURATION_DISTANCE / distance) ** 2)


def force_value(force: float) -> int:
    """Return the value of a force sensor under ``force`` [N]: proportional, up to MAX_VALUE."""
    return min(MAX_VALUE, round(HELD_VALUE * force / HELD_FORCE))
