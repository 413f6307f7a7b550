"""Approaches of a hand to an object, the frame of its fingers, and the plane of a short arm.

The grasp frame follows from the bodies and joints of the fingers, however they are named. An arm
with fewer than six axes moves its hand in a plane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from katana450.arm.control.arm import GripperModel
from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import InputError
from katana450.extensions.hands.sides import (
    MIN_STROKE,
    SNAP_COSINE,
    PlacedBodies,
    frames_of,
    sides_of,
    snapped,
)
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.turns import wrapped
from katana450.maths.physics.suction import SuctionCup
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
        is_cup: whether it is a suction cup.
    """

    T_palm_grasp: FloatArray
    opening: float
    one_jaw: bool = False
    is_cup: bool = False


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
    if hand.cup is not None:
        return _cup_frame(world, hand, hand.cup)
    sides = sides_of(world, hand)
    y, opened = sides.y, sides.gripper.opened
    names = " and ".join(part.name for tip in sides.tips for part in tip[:1])

    def placed(parts: Sequence[Part], value: float) -> PlacedBodies:
        return PlacedBodies(world, parts, hand.palm, value)

    palm = placed([p for p in world.parts if p.mover == hand.palm], opened)
    if sides.jaw is None:
        left, right = (placed(tip, opened) for tip in sides.tips)
        fingers, ends = (left, right), (left, right)
        offset = 0.5 * (left.middle + right.middle) - palm.middle
        inside, outside = left.reach(y), -right.reach(-y)
        across = 0.5 * (inside + outside)
    else:
        jaw, wide = (placed(sides.tips[1], x) for x in (sides.gripper.closed, opened))
        fingers, ends = (jaw, jaw), (jaw, palm)
        offset = sides.jaw.closed - palm.middle
        across = inside = sides.jaw.face
        thick = jaw.reach(y) - inside
        outside = max(-wide.reach(-y), float(sides.jaw.opened @ y) - thick)
    offset = offset - (offset @ y) * y
    if float(np.linalg.norm(offset)) < MIN_STROKE:
        raise InputError(
            f"The fingers {names} do not stand off the palm, so no direction of a grasp is known."
        )
    x = snapped(offset, frames_of(hand), float(SNAP_COSINE), y)
    z = np.cross(x, y)
    if outside - inside < MIN_STROKE:
        raise InputError(f"The fingers {names} leave no room between them when they are open.")
    tip = min(body.reach(x) for body in ends)
    base = max(-body.reach(-x) for body in fingers)
    low = max(-body.reach(-z) for body in fingers)
    high = min(body.reach(z) for body in fingers)
    depth = min(DEPTH, DEPTH_FRACTION * (tip - base))
    origin = (tip - depth) * x + across * y + 0.5 * (low + high) * z
    T = se3.from_rotation_translation(np.column_stack((x, y, z)), origin)
    return GraspFrame(frozen(T), outside - inside, sides.jaw is not None)


CUP_PRESS: Final = 2e-3
"""[m] How much farther than the face a suction cup could go out."""


def _cup_frame(world: CollisionWorld, hand: Hand, cup: SuctionCup) -> GraspFrame:
    """Return the frame of a suction cup: at its rim when it is nearly out, x out of the cup."""
    x = np.append(np.zeros(int(world.linkage.variable.max())), hand.gripper.closed)
    poses = world.linkage.poses(x)
    T = se3.inverse(poses[hand.palm]) @ poses[cup.palm]
    out = T[:3, :3] @ cup.axis
    side = snapped(hand.T_palm_tool[:3, 1], frames_of(hand), float(SNAP_COSINE), out)
    origin = T[:3, :3] @ cup.grasp_point + T[:3, 3] - CUP_PRESS * out
    R = np.column_stack((out, side, np.cross(out, side)))
    return GraspFrame(frozen(se3.from_rotation_translation(R, origin)), math.inf, is_cup=True)


ROLLING_AXES, PLANAR_AXES = 5, 4
"""Numbers of axes with which a hand takes every place, pitch and roll, or every place and pitch."""

STRAIGHT: Final = 1e-3
"""[1] Sine of the angle up to which directions count as parallel."""

MAX_BEND: Final = math.radians(10.0)
"""[rad] Maximum angle between the fingers and the roll axis, along which the hand approaches."""

NOT_IN_PLANE: Final = (
    "An arm with fewer than six axes grasps if axis 1 is upright, axes 2 to 4 are level, and its "
    "fingers point along the plane of the arm. With four axes they also close across it. The "
    "description of this arm has them otherwise."
)


@dataclass(frozen=True, eq=False)
class ArmPlane:
    """The plane in which an arm with fewer than six axes moves its tool. It turns with axis 1.

    Vectors and rotations are in {S} with axis 1 at zero.

    Attributes:
        outward: direction (3,) of the plane, away from axis 1.
        across: unit vector (3,) across it.
        sign: +1 or -1, of the turn of the plane about the vertical with the angle of axis 1.
        R_hand_tool: (3, 3) rotation of the tool in the frame of the hand, whose x axis points along
            the approach, and along whose y axis the fingers close.
        centre: (3,) a point in the frame of the tool that no roll moves [m].
        beside: distance of this point from axis 1 along ``across`` [m].
        rolls: whether the arm chooses the roll.
    """

    outward: FloatArray
    across: FloatArray
    sign: float
    R_hand_tool: FloatArray
    centre: FloatArray
    beside: float
    rolls: bool

    @staticmethod
    def of(chain: Chain, T_tool_grasp: FloatArray, ready: FloatArray) -> ArmPlane:
        """Return the plane of an arm whose tool is in front of axis 1 at ``ready`` (n,) [rad].

        Raises InputError for an arm that does not move its hand in a plane.
        """
        across, rolls = np.array(chain.S[:3, 1]), chain.n == ROLLING_AXES
        level = max(abs(float(axis[2])) for axis in chain.S[:3, 1:PLANAR_AXES].T)
        if level > STRAIGHT or abs(abs(float(chain.S[2, 0])) - 1.0) > STRAIGHT:
            raise InputError(NOT_IN_PLANE)
        T = forward(chain, np.append(0.0, ready[1:]))
        R_grasp, centre = T[:3, :3] @ T_tool_grasp[:3, :3], np.zeros(3)
        outward = np.cross(across, UP)
        place = T[:3, 3] + T[:3, :3] @ T_tool_grasp[:3, 3]
        outward = math.copysign(1.0, float(outward @ place)) * outward
        x, y = R_grasp[:, 0], R_grasp[:, 1]
        if rolls:
            x, centre = _roll_axis(chain, T_tool_grasp)
            x, y = T[:3, :3] @ x, y - (y @ T[:3, :3] @ x) * T[:3, :3] @ x
        pitch = math.atan2(-x[2], float(x @ outward))
        R_hand = np.column_stack((x, y / np.linalg.norm(y), np.cross(x, y) / np.linalg.norm(y)))
        closing = _level(outward, pitch).T @ R_hand[:, 1]
        if abs(float(x @ across)) > STRAIGHT or (not rolls and abs(float(closing[2])) > STRAIGHT):
            raise InputError(NOT_IN_PLANE)
        if not rolls:
            R_hand = R_hand @ so3.rotation_x(-math.atan2(closing[2], closing[1]))
        return ArmPlane(
            frozen(outward),
            frozen(across),
            math.copysign(1.0, float(chain.S[2, 0])),
            frozen(R_hand.T @ T[:3, :3]),
            frozen(centre),
            float(across @ (T[:3, 3] + T[:3, :3] @ centre)),
            rolls,
        )

    def rotation(self, pitch: float, roll: float) -> FloatArray:
        """Return the rotation (3, 3) of the tool with ``pitch`` and ``roll`` of the hand [rad]."""
        return np.asarray(_level(self.outward, pitch) @ so3.rotation_x(roll) @ self.R_hand_tool)

    def angles(self, R: FloatArray) -> tuple[float, float]:
        """Return pitch and roll of the hand [rad] with the tool at rotation `R` (3, 3)."""
        H = _level(self.outward, 0.0).T @ R @ self.R_hand_tool.T
        return math.atan2(-H[2, 0], H[0, 0]), math.atan2(-H[1, 2], H[1, 1])

    def beside_at(self, R: FloatArray, inside: FloatArray) -> float:
        """Return the distance [m] of a point of the tool from axis 1, along ``across``.

        R: (3, 3) rotation of the tool. inside: (3,) the point in the frame of the tool [m].
        """
        return self.beside + float(self.across @ R @ (inside - self.centre))

    def turn(self, p: FloatArray, distance: float) -> float:
        """Return the turn [rad] about axis 1 that brings a point beside the plane to `p` (3,).

        distance: of the point from axis 1 [m], along ``across``. Raises InputError for a point too
        near to axis 1.
        """
        outward = math.hypot(p[0], p[1]) ** 2 - distance**2
        if outward < 0.0:
            raise InputError("it stands too near to axis 1, where the plane of the arm cannot be.")
        point = math.sqrt(outward) * self.outward + distance * self.across
        return wrapped(math.atan2(p[1], p[0]) - math.atan2(point[1], point[0]))


def _roll_axis(chain: Chain, T_tool_grasp: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return direction and nearest point (3,) of the last axis in the frame of the tool [m].

    The direction is that of the fingers. Raises InputError if they point beside it.
    """
    p, axis, v = chain.M[:3, 3], chain.S[:3, -1], chain.S[3:, -1]
    R = chain.M[:3, :3].T
    x, centre = R @ axis, R @ (np.cross(axis, v) + (axis @ p) * axis - p)
    x = math.copysign(1.0, float(x @ T_tool_grasp[:3, 0])) * x
    bend = math.acos(min(float(x @ T_tool_grasp[:3, 0]), 1.0))
    if bend > MAX_BEND:
        raise InputError(
            "The hand of five axes grasps along its roll axis, and its fingers point "
            f"{math.degrees(bend):.0f} deg beside it; the maximum is "
            f"{math.degrees(MAX_BEND):.0f} deg."
        )
    return x, centre


def _level(outward: FloatArray, pitch: float) -> FloatArray:
    """Return the rotation (3, 3) of a hand with ``pitch`` [rad] in the plane along ``outward``."""
    return so3.from_rpy(0.0, pitch, math.atan2(outward[1], outward[0]))
