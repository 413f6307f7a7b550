"""The directions from which a hand comes to an object, and those in which the object fits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.turns import wrapped
from katana450.maths.planning.plan import MARGIN

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

MAX_ASIDE: Final = math.radians(100.0)
"""[rad] Maximum angle between the hand and the direction away from axis 1, seen from above."""

ASIDE: Final = tuple(np.radians((0.0, 40.0, -40.0)).tolist())
"""[rad] Angles of the hand beside that direction for round objects, in the order of trial."""

ROUND_ROLLS: Final = tuple(np.radians((0.0, 60.0, -60.0)).tolist())
"""[rad] Turns of the hand over a round object, in the order of trial."""

JAW_ROOM: Final = MARGIN + 1e-3
"""[m] Distance of an object from a fixed jaw, before the other one pushes it there."""


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


Widths = Mapping[str, Sequence[tuple[Approach, float]]]
"""Approaches by side, each with the width [m] of the object between the fingers."""


def symmetry(held: SceneObject) -> float:
    """Return the angle [rad] by which the object may turn and look the same; 0 for any."""
    if held.shape is Shape.BOX:
        along_x, along_y, _ = held.extent
        return 0.5 * math.pi if math.isclose(along_x, along_y) else math.pi
    return 0.0 if held.shape.is_round else math.tau


def widths(
    pitches: Sequence[float], scene_object: SceneObject, place: FloatArray, side: FloatArray
) -> dict[str, list[tuple[Approach, float]]]:
    """Return all approaches at ``pitches`` [rad], whether the object fits or not.

    The object stands at ``place`` (3,) [m] with its x axis along ``side`` (3,), both in {S}. The
    fingers close on two opposite sides of a box or mesh. A vessel is only grasped from the front.
    """
    if scene_object.shape.is_round:
        width = 2.0 * scene_object.extent[0]
        front = [(Approach(p, 0.0, aside), width) for aside in ASIDE for p in pitches]
        above = [(Approach(DOWN, roll), width) for roll in ROUND_ROLLS]
        return {FRONT: front} if is_vessel(scene_object) else {FRONT: front, ABOVE: above}
    sizes = scene_object.extent[1], scene_object.extent[0]
    skew = math.atan2(place[1], place[0]) - math.atan2(side[1], side[0])
    rolls = [(wrapped(skew + k * DOWN), sizes[k % 2]) for k in range(4)]
    asides = [(wrapped(k * DOWN - skew), sizes[k % 2]) for k in range(4)]
    near = sorted(asides, key=lambda option: abs(option[0]))
    return {
        ABOVE: [
            (Approach(DOWN, roll), width)
            for roll, width in sorted(rolls, key=lambda option: abs(option[0]))
        ],
        FRONT: [
            (Approach(p, 0.0, aside), width)
            for aside, width in near
            if abs(aside) <= MAX_ASIDE
            for p in pitches
        ],
    }


def fitting(options: Widths, opening: float, *, one_jaw: bool) -> Mapping[str, Sequence[Approach]]:
    """Return the approaches of ``options`` between whose fingers the object fits.

    opening: distance between the open fingers [m]. one_jaw: whether one of them is a fixed jaw; the
    object is beside it then. Raises InputError, with the widths, if there is none.
    """
    most = opening - ((JAW_ROOM if one_jaw else MARGIN) + MARGIN)
    approaches = {
        name: tuple(
            approach._replace(shift=JAW_ROOM + 0.5 * width) if one_jaw else approach
            for approach, width in pairs
            if width <= most
        )
        for name, pairs in options.items()
    }
    if not any(approaches.values()):
        width = min(width for pairs in options.values() for _, width in pairs)
        room = "on either side"
        if one_jaw:
            room = f"beside the moving jaw and {1e3 * JAW_ROOM:.0f} mm beside the fixed one"
        raise InputError(
            f"it is {1e3 * width:.0f} mm wide, which is too wide: the open fingers are "
            f"{1e3 * opening:.0f} mm apart and need {1e3 * MARGIN:.0f} mm of room {room}, so an "
            f"object may have {1e3 * most:.0f} mm."
        )
    return approaches
