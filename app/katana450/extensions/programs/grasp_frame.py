"""The grasp frame of a hand, from the bodies and joints of its fingers, however they are named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from katana450.arm.control.arm import GripperModel
from katana450.arm.control.scene_objects import Hand
from katana450.errors import InputError
from katana450.maths.collision.shape import half_space
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen

FAR: Final = 10.0
"""[m] Distance of the planes from which the extent of bodies is measured."""

DEPTH: Final = 0.01
"""[m] Distance of the grasp frame behind the fingertips, at most."""

DEPTH_FRACTION: Final = 0.25
"""[1] The same as a fraction of the length of the fingers, at most."""

SNAP: Final = np.cos(np.radians(30.0))
"""[1] Cosine of the angle up to which an axis of the tool or the palm stands for a direction."""

ALONG: Final = np.cos(np.radians(5.0))
"""[1] The same for the direction in which the fingers close."""

MIN_STROKE: Final = 2e-3
"""[m] Minimum change of the distance of two fingers that can grasp."""

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
            open fingers, a little behind their tips. x points from the palm to the tips, and the
            fingers close along y.
        opening: distance between the open fingers [m].
    """

    T_palm_grasp: FloatArray
    opening: float


class _Bodies:
    """Bodies placed in the frame of the palm."""

    def __init__(self, world: CollisionWorld, parts: Sequence[Part], palm: int, x: FloatArray):
        T = world.linkage.poses(x)
        T_palm_base = se3.inverse(T[palm])
        placed = [
            (shape, T_palm_base @ T[part.mover] @ T_mover_shape)
            for part in parts
            for T_mover_shape, shape in zip(part.T_mover_shape, part.shapes, strict=True)
        ]
        self._engine = world.engine
        self._placed: list[tuple[Any, Any]] = [
            (shape.geometry, world.engine.transform(T_palm_shape)) for shape, T_palm_shape in placed
        ]
        middles = [T[:3, :3] @ shape.centre + T[:3, 3] for shape, T in placed]
        self.middle: FloatArray = np.mean(middles, axis=0) if middles else np.zeros(3)

    def reach(self, u: FloatArray) -> float:
        """Return how far the bodies reach along the unit vector `u` (3,) [m]."""
        plane = self._engine.transform(se3.from_rotation_translation(_with_z(-u), FAR * u))
        beyond = half_space().geometry
        return FAR - min(
            self._engine.distance(geometry, T, beyond, plane) for geometry, T in self._placed
        )


def grasp_frame(
    world: CollisionWorld | None, hand: Hand | None, gripper: GripperModel, axes: int
) -> GraspFrame:
    """Return the grasp frame of ``hand``.

    ``axes`` is the number of axes of the arm. Raises InputError, with the reason, for a hand that
    cannot grasp.
    """
    if not gripper.moves:
        raise InputError(NO_FINGERS)
    if world is None or hand is None or not hand.fingers:
        raise InputError(NO_BODIES)
    fingers = [part for part in world.parts if part.name in hand.fingers]
    lower, upper = (np.append(np.zeros(axes), end) for end in (gripper.lower, gripper.upper))

    def placed(parts: Sequence[Part], x: FloatArray) -> _Bodies:
        return _Bodies(world, parts, hand.palm, x)

    if len(fingers) == 1:
        raise InputError(
            f"The gripper has one finger with a body that moves, {fingers[0].name}, and two that "
            "close on each other are needed to grasp."
        )
    if len(fingers) > 2:
        listed = ", ".join(finger.name for finger in fingers)
        raise InputError(
            f"The gripper moves {len(fingers)} links with bodies ({listed}), and objects are held "
            "between two. Leave out the collision shapes of those that do not touch objects."
        )
    one, other = (placed([f], upper).middle - placed([f], lower).middle for f in fingers)
    stroke, names = other - one, f"{fingers[0].name} and {fingers[1].name}"
    if float(one @ other) >= 0.0 or float(np.linalg.norm(stroke)) < MIN_STROKE:
        raise InputError(f"The fingers {names} do not close on each other, so they cannot grasp.")
    left, right = (placed([finger], upper) for finger in fingers)
    near, far = (
        abs(float((placed(fingers[1:], x).middle - placed(fingers[:1], x).middle) @ stroke))
        for x in (lower, upper)
    )
    if near > far:
        raise InputError(
            f"The fingers {names} close towards the upper end of the range of their joint, and "
            "objects are grasped only by fingers that close towards the lower end. Reverse the "
            "axis of the joint and the signs of its limits in the description of the arm."
        )
    frames = (hand.T_palm_tool[:3, :3], np.eye(3))
    y = _snapped(stroke, frames, ALONG, None)
    behind = placed([p for p in world.parts if p.mover == hand.palm], upper).middle
    ahead = 0.5 * (left.middle + right.middle) - behind
    ahead = ahead - (ahead @ y) * y
    if float(np.linalg.norm(ahead)) < MIN_STROKE:
        raise InputError(
            f"The fingers {names} do not stand off the palm, so no direction of a grasp is known."
        )
    x = _snapped(ahead, frames, float(SNAP), y)
    z = np.cross(x, y)
    inside, outside = left.reach(y), -right.reach(-y)
    if outside - inside < MIN_STROKE:
        raise InputError(f"The fingers {names} leave no room between them when they are open.")
    tip = min(left.reach(x), right.reach(x))
    base = max(-left.reach(-x), -right.reach(-x))
    low = max(-left.reach(-z), -right.reach(-z))
    high = min(left.reach(z), right.reach(z))
    depth = min(DEPTH, DEPTH_FRACTION * (tip - base))
    origin = (tip - depth) * x + 0.5 * (inside + outside) * y + 0.5 * (low + high) * z
    T = se3.from_rotation_translation(np.column_stack((x, y, z)), origin)
    return GraspFrame(frozen(T), outside - inside)


def _snapped(
    wanted: FloatArray, frames: Sequence[FloatArray], near: float, across: FloatArray | None
) -> FloatArray:
    """Return the unit vector along ``wanted`` (3,), or the axis of one of ``frames`` beside it.

    An axis stands for it if the cosine of their angle is at least ``near``. The result is
    perpendicular to ``across``, to which ``wanted`` is, too.
    """
    unit = wanted / np.linalg.norm(wanted)
    axes = [sign * column for R in frames for column in R.T for sign in (1.0, -1.0)]
    if across is not None:
        axes = [axis for axis in axes if abs(float(axis @ across)) < 1e-3]
    best = max(axes, key=lambda axis: float(axis @ unit), default=unit)
    chosen: FloatArray = best if float(best @ unit) >= near else unit
    if across is not None:
        chosen = chosen - (chosen @ across) * across
        chosen = chosen / np.linalg.norm(chosen)
    return chosen


def _with_z(u: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is the unit vector ``u`` (3,)."""
    x = np.eye(3)[int(np.abs(u).argmin())]
    x = x - (x @ u) * u
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(u, x), u))
