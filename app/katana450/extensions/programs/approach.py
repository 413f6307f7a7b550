"""The direction from which the hand comes to an object."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.maths.geometry.arrays import frozen

DOWN = 0.5 * math.pi
"""[rad] Pitch of the tool for a grasp from above."""

FRONT, ABOVE = "front", "above"
"""The sides from which an object is grasped."""

LOW = 0.045
"""[m] Height below which an object is also grasped by the fingertips."""

UP: Final = frozen((0.0, 0.0, 1.0))
"""The vertical direction (3,)."""

YAW_TOLERANCE = math.radians(0.5)
"""[rad] Difference up to which an object is turned as requested."""


class Approach(NamedTuple):
    """The direction in which the tool comes to an object, and its turn about it [rad].

    Attributes:
        pitch: angle of the direction below the horizontal.
        roll: turn about it; at 0 the fingers close horizontally.
        aside: turn of the direction about the vertical, from straight away from axis 1.
        shift: distance [m] of the object's middle from the grasp frame, along its y axis.
    """

    pitch: float
    roll: float = 0.0
    aside: float = 0.0
    shift: float = 0.0


def symmetry(held: SceneObject) -> float:
    """Return the angle [rad] by which the object may turn and look the same; 0 for any."""
    if held.shape is Shape.BOX:
        along_x, along_y, _ = held.extent
        return 0.5 * math.pi if math.isclose(along_x, along_y) else math.pi
    return 0.0 if held.shape.is_round else math.tau
