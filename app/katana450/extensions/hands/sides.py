"""The two sides of a hand or its suction cup, and the end of the range at which it is closed.

Links that one joint moves rigidly together form a group. The two groups that move most against each
other are the fingertips. A group that stands on one side and moves with its fingertip, such as the
bars of a linkage, belongs to that side. All others belong to neither side.
If all groups move the same way, they are the moving jaw, and a body of the palm is the fixed one.
A suction cup is a single link on a joint that slides, named for it. It is closed when it is out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from katana450.arm.control.arm import GripperModel
from katana450.arm.control.objects.environment import Hand
from katana450.errors import InputError
from katana450.maths.collision.engine import Placement, Witness, distance, witness
from katana450.maths.collision.shape import CollisionShape, half_space, placement, sphere
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.physics.suction import SuctionCup

PLANE_DISTANCE: Final = 10.0
"""[m] Distance of the planes from which the extent of bodies is measured."""

HALF_SPACE: Final = half_space()

SUCTION: Final = re.compile("suction|vacuum", re.IGNORECASE)
"""Words in the name of a link that is a suction cup."""

PROBE: Final = sphere(1e-5)
"""The ball that stands for a point."""


class PlacedBodies:
    """Bodies placed in the frame of the palm.

    Attributes:
        middle: (3,) the mean of their middles [m].
    """

    def __init__(
        self, world: CollisionWorld, parts: Sequence[Part], palm: int, gripper: float
    ) -> None:
        """Place ``parts`` with the finger joint at ``gripper`` [rad or m].

        ``palm``: index of the group of the palm in the linkage of ``world``.
        """
        T = world.linkage.poses(np.append(np.zeros(int(world.linkage.variable.max())), gripper))
        self._T, self._T_palm_base = T, se3.inverse(T[palm])
        placed = [
            (shape, self._T_palm_base @ T[part.mover] @ T_mover_shape)
            for part in parts
            for T_mover_shape, shape in zip(part.T_mover_shape, part.shapes, strict=True)
        ]
        self._placed = placed
        middles = [T[:3, :3] @ shape.centre + T[:3, 3] for shape, T in placed]
        self.middle: FloatArray = np.mean(middles, axis=0) if middles else np.zeros(3)

    def reach(self, u: FloatArray) -> float:
        """Return how far the bodies reach along the unit vector `u` (3,) [m]."""
        placed, plane = self._with(HALF_SPACE, _plane(u)), len(self._placed)
        return PLANE_DISTANCE - min(distance(placed, body, plane) for body in range(plane))

    def farthest(self, u: FloatArray) -> FloatArray:
        """Return the point (3,) [m] of the bodies that is farthest along the unit vector `u`."""
        placed, plane = self._with(HALF_SPACE, _plane(u)), len(self._placed)
        contacts = [witness(placed, body, plane) for body in range(plane)]
        return np.asarray(min(contacts, key=lambda contact: contact.distance).points[0])

    def nearest(self, point: FloatArray) -> Witness:
        """Return the nearest point of the bodies to ``point`` (3,) [m], which comes first."""
        T = se3.from_rotation_translation(np.eye(3), point)
        placed, ball = self._with(PROBE, T), len(self._placed)
        contacts = [witness(placed, ball, body) for body in range(ball)]
        return min(contacts, key=lambda contact: contact.distance)

    def _with(self, shape: CollisionShape, T: FloatArray) -> Placement:
        """Return the geometries of the bodies, and then that of ``shape`` at ``T`` (4, 4) [m]."""
        return placement(*self._placed, (shape, T))

    def T_palm_group(self, group: int) -> FloatArray:
        """Return the pose (4, 4) of a group of the linkage."""
        return np.asarray(self._T_palm_base @ self._T[group])


def _plane(u: FloatArray) -> FloatArray:
    """Return the pose (4, 4) of a half-space that begins beyond the bodies along ``u`` (3,) [m]."""
    return se3.from_rotation_translation(_with_z(-u), PLANE_DISTANCE * u)


def _with_z(u: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is the unit vector ``u`` (3,)."""
    x = np.eye(3)[int(np.abs(u).argmin())]
    x = x - (x @ u) * u
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(u, x), u))


MIN_STROKE: Final = 2e-3
"""[m] Minimum change of the distance of two fingers that can grasp."""

MIN_MOTION: Final = 1e-3
"""[m] Motion of its middle below which a group belongs to neither side."""

MIN_OFFSET: Final = 1e-3
"""[m] Minimum distance of the middle of a jaw from its axis: it gives the direction to the tip."""

MIN_ALIGNMENT: Final = 0.5
"""[1] Cosine of the angle up to which a group moves with the fingertip of its side."""

SNAP_COSINE: Final = np.cos(np.radians(30.0))
"""[1] Cosine of the angle up to which an axis of the tool or the palm stands for a direction."""

CLOSING_SNAP_COSINE: Final = np.cos(np.radians(5.0))
"""[1] Cosine of the angle up to which an axis stands for the closing direction of two fingers."""

MAX_FACE_GAP: Final = 0.02
"""[m] Maximum distance of the tip of a closed jaw from what it closes against."""

FACE_FRACTIONS: Final = (0.02, 0.05, 0.1, 0.2, 0.3)
"""[1] Fractions of the range at which the direction from a jaw to the palm is measured."""

MIN_TIP_DISTANCE: Final = 2e-3
"""[m] Distance of the tip from the palm from which on that direction is certain."""

Groups = Mapping[int, Sequence[Part]]
"""The parts of the fingers, by the groups of the linkage."""

Motions = Mapping[int, FloatArray]
"""The motion (3,) [m] of the middle of each group from the lower to the upper end of the range."""


class JawPlaces(NamedTuple):
    """Places of the moving and the fixed jaw, in the frame of the palm [m].

    Attributes:
        name: of the part with the fixed jaw.
        face: its position along y of `Sides`.
        closed, opened: (3,) tip of the moving jaw at both ends of its range.
    """

    name: str
    face: float
    closed: FloatArray
    opened: FloatArray


@dataclass(frozen=True, eq=False)
class Sides:
    """The two sides of a hand. Fingers close along y, and the second side is at larger y.

    Attributes:
        parts: the parts of the fingers on either side, those at the tips first. The first is empty
            if the fixed jaw is there.
        tips: the parts of these that move rigidly with the fingertip.
        y: (3,) unit vector in the frame of the palm.
        gripper: that of the hand, with its closed end.
        jaw: the places of both jaws if one is fixed; None if both sides move.
    """

    parts: tuple[tuple[Part, ...], tuple[Part, ...]]
    tips: tuple[tuple[Part, ...], tuple[Part, ...]]
    y: FloatArray
    gripper: GripperModel
    jaw: JawPlaces | None = None


def with_sides(world: CollisionWorld, hand: Hand) -> Hand:
    """Return ``hand`` with its sides and its closed end; unchanged if they are not understood."""
    if not hand.fingers:
        return hand
    fingers = [part for part in world.parts if part.name in hand.fingers]
    if SUCTION.search(fingers[0].name) and fingers[0].mover in world.linkage.sliding:
        return _with_cup(world, hand, fingers)
    try:
        sides = sides_of(world, hand)
    except InputError:
        return hand
    jaw = sides.jaw
    palm = tuple(part.name for part in world.parts if part.mover == hand.palm)
    return replace(
        hand,
        gripper=sides.gripper,
        sides=tuple(tuple(part.name for part in side) for side in sides.parts if side),
        fixed_jaw=() if jaw is None else palm,
    )


def _with_cup(world: CollisionWorld, hand: Hand, fingers: Sequence[Part]) -> Hand:
    """Return ``hand`` with the suction cup of the links ``fingers``, which point out of the palm.

    Its rim is as wide as they are.
    """
    group, gripper = fingers[0].mover, hand.gripper
    low, high = (
        PlacedBodies(world, fingers, hand.palm, end) for end in (gripper.lower, gripper.upper)
    )
    palm = [part for part in world.parts if part.mover == hand.palm]
    T = low.T_palm_group(group)
    axis = T[:3, :3] @ world.linkage.axis[group]
    out = low.middle - PlacedBodies(world, palm, hand.palm, gripper.lower).middle
    axis = math.copysign(1.0, float(out @ axis)) * axis
    across = _with_z(axis)[:, :2].T
    radius = 0.5 * min(low.reach(side) + low.reach(-side) for side in across)
    rim = low.middle + (low.reach(axis) - low.middle @ axis) * axis
    T_group_palm = se3.inverse(T)
    rim, axis = (T_group_palm @ (*rim, 1.0))[:3], T_group_palm[:3, :3] @ axis
    ends = gripper.upper, gripper.lower
    closed, opened = ends if float((high.middle - low.middle) @ out) > 0.0 else ends[::-1]
    return replace(
        hand,
        gripper=replace(gripper, closed=closed, opened=opened, is_cup=True),
        sides=(hand.fingers,),
        cup=SuctionCup(group, frozen(rim), frozen(axis), radius),
    )


def sides_of(world: CollisionWorld, hand: Hand) -> Sides:
    """Return the sides of ``hand``, which has fingers.

    Raises InputError, with the names of the links, for a hand that does not close on an object.
    """
    groups: dict[int, list[Part]] = {}
    for part in world.parts:
        if part.name in hand.fingers:
            groups.setdefault(part.mover, []).append(part)
    ends = hand.gripper.lower, hand.gripper.upper
    moved: dict[int, FloatArray] = {}
    for mover, parts in groups.items():
        low, high = (PlacedBodies(world, parts, hand.palm, end).middle for end in ends)
        if float(np.linalg.norm(high - low)) >= MIN_MOTION:
            moved[mover] = high - low
    against = {
        (a, b): _length(moved[b] - moved[a])
        for a, b in combinations(moved, 2)
        if float(moved[a] @ moved[b]) < 0.0
    }
    tips = max(against, key=against.__getitem__, default=None)
    if tips is not None and against[tips] >= MIN_STROKE:
        return _of_two_fingers(world, hand, groups, moved, tips)
    return _of_one_jaw(world, hand, groups, moved)


def _of_two_fingers(
    world: CollisionWorld, hand: Hand, groups: Groups, moved: Motions, tips: tuple[int, int]
) -> Sides:
    """Return the sides of fingers whose tips are those of the groups ``tips``."""
    one, other = (groups[mover] for mover in tips)
    stroke = moved[tips[1]] - moved[tips[0]]
    direction = stroke / np.linalg.norm(stroke)

    def middle(parts: Sequence[Part], value: float) -> FloatArray:
        return PlacedBodies(world, parts, hand.palm, value).middle

    def apart(value: float) -> float:
        return abs(float((middle(other, value) - middle(one, value)) @ direction))

    gripper = _closed_where(hand.gripper, apart)
    sign = 1.0 if gripper.opened > gripper.closed else -1.0
    y = snapped(sign * stroke, frames_of(hand), float(CLOSING_SNAP_COSINE), None)
    between = 0.5 * float((middle(one, gripper.opened) + middle(other, gripper.opened)) @ y)
    sides: tuple[list[Part], list[Part]] = ([*one], [*other])
    for mover, motion in moved.items():
        if mover in tips:
            continue
        along = sign * float(motion @ y)
        if abs(along) < MIN_ALIGNMENT * float(np.linalg.norm(motion)):
            raise InputError(
                f"The gripper moves {_listed(groups[mover])} across the direction in which "
                f"{_listed(one)} and {_listed(other)} close, and objects are held between two "
                "sides. Leave out the collision shapes of links that do not touch objects."
            )
        if (along > 0.0) == (float(middle(groups[mover], gripper.opened) @ y) > between):
            sides[along > 0.0].extend(groups[mover])
    return Sides((tuple(sides[0]), tuple(sides[1])), (tuple(one), tuple(other)), y, gripper)


def _of_one_jaw(world: CollisionWorld, hand: Hand, groups: Groups, moved: Motions) -> Sides:
    """Return the sides of one jaw that closes against a body of the palm."""
    names = " and ".join(_listed(parts) for parts in groups.values())
    refusal = InputError(
        f"The gripper moves {names}, which closes neither on another finger nor on a body of the "
        "palm, so it cannot grasp. Its joints must bring two collision shapes together."
    )
    main = max(moved, key=lambda mover: _length(moved[mover]), default=None)
    palm = [part for part in world.parts if part.mover == hand.palm]
    if (
        main is None
        or not palm
        or any(_astray(candidate, moved[main]) for candidate in moved.values())
    ):
        raise refusal
    fixed = PlacedBodies(world, palm, hand.palm, hand.gripper.lower)

    def tip(value: float) -> FloatArray:
        return _tip(world, hand, groups[main], moved[main], value, fixed.middle)

    def apart(value: float) -> float:
        return fixed.nearest(tip(value)).distance

    gripper = _closed_where(hand.gripper, apart)
    closed, opened = gripper.closed, gripper.opened
    facing = (
        fixed.nearest(tip(closed + fraction * (opened - closed))) for fraction in FACE_FRACTIONS
    )
    jaw = next((candidate for candidate in facing if candidate.distance >= MIN_TIP_DISTANCE), None)
    if jaw is None or apart(closed) > MAX_FACE_GAP or apart(opened) - apart(closed) < MIN_STROKE:
        raise refusal
    y = snapped(jaw.points[0] - jaw.points[1], frames_of(hand), float(SNAP_COSINE), None)
    moving = [*groups[main], *(part for m in moved if m != main for part in groups[m])]

    def far(part: Part) -> float:
        bodies = PlacedBodies(world, [part], hand.palm, closed)
        return bodies.nearest(jaw.points[1]).distance

    name = min(palm, key=far).name
    places = JawPlaces(name, float(jaw.points[1] @ y), tip(closed), tip(opened))
    return Sides(((), tuple(moving)), ((), tuple(groups[main])), y, gripper, places)


def _length(motion: FloatArray) -> float:
    """Return the length of ``motion`` [m], rounded: of equal ones the first is the longest.

    Else rounding would decide, which is not the same on all processors.
    """
    return round(float(np.linalg.norm(motion)), 9)


def _closed_where(gripper: GripperModel, apart: Callable[[float], float]) -> GripperModel:
    """Return ``gripper``, closed at the end at which its fingers are less far ``apart`` [m]."""
    lower, upper = gripper.lower, gripper.upper
    if apart(lower) > apart(upper):
        return replace(gripper, closed=upper, opened=lower)
    return replace(gripper, closed=lower, opened=upper)


def _astray(motion: FloatArray, other: FloatArray) -> bool:
    """Return whether two groups do not move the same way."""
    size = float(np.linalg.norm(motion) * np.linalg.norm(other))
    return float(motion @ other) < MIN_ALIGNMENT * size


def _tip(
    world: CollisionWorld,
    hand: Hand,
    parts: Sequence[Part],
    motion: FloatArray,
    value: float,
    behind: FloatArray,
) -> FloatArray:
    """Return the tip (3,) [m] of a jaw with the finger joint at ``value`` [rad or m].

    It is the point farthest in the direction from the joint axis to the middle of the jaw. If the
    jaw slides, the axis is the line along its motion through ``behind`` (3,) [m], the middle of the
    palm. Raises InputError if the middle of the jaw is on the axis.
    """
    placed = PlacedBodies(world, parts, hand.palm, value)
    linkage, mover = world.linkage, parts[0].mover
    root, axis = behind, motion / np.linalg.norm(motion)
    line = "a line along its motion through the middle of the palm"
    if mover not in linkage.sliding:
        T = placed.T_palm_group(mover)
        root, axis, line = T[:3, 3], T[:3, :3] @ linkage.axis[mover], "the axis of its joint"
    out = placed.middle - root
    out = out - (out @ axis) * axis
    length = float(np.linalg.norm(out))
    if length < MIN_OFFSET:
        raise InputError(
            f"The middle of {_listed(parts)} is on {line}, so the direction to its tip is not "
            "known. Give it collision shapes that reach off this line."
        )
    return placed.farthest(out / length)


def snapped(
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


def frames_of(hand: Hand) -> tuple[FloatArray, FloatArray]:
    """Return the rotations (3, 3) of the tool and of the palm, in the frame of the palm."""
    return hand.T_palm_tool[:3, :3], np.eye(3)


def _listed(parts: Sequence[Part]) -> str:
    return ", ".join(part.name for part in parts)
