"""The grasp frame of a hand, from the bodies and joints of its fingers, however they are named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.arm.control.environment import Hand
from katana450.arm.control.gripper_model import GripperModel
from katana450.errors import InputError
from katana450.extensions.hands.placed_bodies import PlacedBodies
from katana450.extensions.hands.sides import MIN_STROKE, SNAP_COSINE, frames_of, sides_of, snapped
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen

DEPTH: Final = 0.01
"""[m] Maximum distance of the grasp frame behind the fingertips."""

DEPTH_FRACTION: Final = 0.25
"""[1] Maximum distance of the grasp frame behind the fingertips, as a fraction of the length of the
fingers.
"""

NO_FINGERS: Final = (
    "This arm has no gripper: its description has no finger joints behind the last axis. Steps "
    "that grasp, pick or place need fingers."
)
NO_BODIES: Final = (
    "The contacts of the fingers cannot be computed, because their links have no collision shapes. "
    "Add them to the description of the arm."
)


@dataclass(frozen=True, eq=False)
class GraspFrame:
    """Where the fingers of a hand meet.

    Attributes:
        T_palm_grasp: (4, 4) pose in the frame of the palm [m]. The origin is half-way between the
            open fingers, a little behind their tips, or on the face of a fixed jaw. x points
            from the palm to the tips, and the fingers close along y; a fixed jaw is at -y.
        opening: distance between the open fingers [m].
        one_jaw: whether one jaw closes against a fixed one.
    """

    T_palm_grasp: FloatArray
    opening: float
    one_jaw: bool = False


def grasp_frame(
    world: CollisionWorld | None, hand: Hand | None, gripper: GripperModel
) -> GraspFrame:
    """Return the grasp frame of ``hand``.

    Raises InputError, with the reason, for a hand that cannot grasp.
    """
    if not gripper.moves:
        raise InputError(NO_FINGERS)
    if world is None or hand is None or not hand.fingers:
        raise InputError(NO_BODIES)
    sides = sides_of(world, hand)
    y, opened = sides.y, sides.gripper.opened
    names = " and ".join(part.name for tip in sides.tips for part in tip[:1])

    def placed(parts: Sequence[Part], value: float) -> PlacedBodies:
        return PlacedBodies(world, parts, hand.palm, value)

    palm = placed([p for p in world.parts if p.mover == hand.palm], opened)
    if sides.jaw is None:
        left, right = (placed(tip, opened) for tip in sides.tips)
        fingers, ends = (left, right), (left, right)
        ahead = 0.5 * (left.middle + right.middle) - palm.middle
        inside, outside = left.reach(y), -right.reach(-y)
        across = 0.5 * (inside + outside)
    else:
        jaw, wide = (placed(sides.tips[1], x) for x in (sides.gripper.closed, opened))
        fingers, ends = (jaw, jaw), (jaw, palm)
        ahead = sides.jaw.closed - palm.middle
        across = inside = sides.jaw.face
        thick = jaw.reach(y) - inside
        outside = max(-wide.reach(-y), float(sides.jaw.opened @ y) - thick)
    ahead = ahead - (ahead @ y) * y
    if float(np.linalg.norm(ahead)) < MIN_STROKE:
        raise InputError(
            f"The fingers {names} do not stand off the palm, so no direction of a grasp is known."
        )
    x = snapped(ahead, frames_of(hand), float(SNAP_COSINE), y)
    z = np.cross(x, y)
    if outside - inside < MIN_STROKE:
        raise InputError(f"The fingers {names} leave no room between them when they are open.")
    tip = min(each.reach(x) for each in ends)
    base = max(-each.reach(-x) for each in fingers)
    low = max(-each.reach(-z) for each in fingers)
    high = min(each.reach(z) for each in fingers)
    depth = min(DEPTH, DEPTH_FRACTION * (tip - base))
    origin = (tip - depth) * x + across * y + 0.5 * (low + high) * z
    T = se3.from_rotation_translation(np.column_stack((x, y, z)), origin)
    return GraspFrame(frozen(T), outside - inside, sides.jaw is not None)
