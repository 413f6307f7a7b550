"""Objects around the arm that can be moved, and the objects that its gripper holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

import numpy as np

from katana450.arm.control.state.object_joint import ObjectJoint
from katana450.arm.control.state.solid import PLAIN, ObjectAppearance, Solid
from katana450.errors import InputError, digits_beyond
from katana450.maths.collision.shape import CollisionShape, box, cylinder, hull, sphere
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

MAX_OBJECTS = 64
"""Maximum number of objects at a time."""

MAX_COORDINATE = 2.0
"""[m] Maximum distance of an object from the base along any axis."""

MAX_SIZE, MIN_SIZE = 2.0, 1e-3
"""[m] Bounds of the size of an object along any of its sides."""

ROUNDING = 1e-6
"""[1] Tolerance of a bound, for the size of a mesh in single precision."""

MAX_CRUSH_FORCE = 1e4
"""[N] Maximum force that an object can be said to bear."""

MIN_SCALE, MAX_SCALE = 1e-3, 1e3

PLANE_DEPTH = 10.0
"""[m] How far the space below a plane is checked to each side, and down. No arm reaches so far."""

MAX_NAME_LENGTH = 40


class Shape(Enum):
    """Shape that stands for an object in collision checks."""

    BOX = "box"
    """size: along x, y, z."""
    CYLINDER = "cylinder"
    """size: radius, height."""
    VESSEL = "vessel"
    """size: radius, height. An open vessel of the form of the cup, which can hold water."""
    SPHERE = "sphere"
    """size: radius."""
    MESH = "mesh"
    """size: along x, y, z, of its solid."""
    PLANE = "plane"
    """size: along x, y, as drawn. A zone: all of the space below z = 0 of its frame."""

    @property
    def is_round(self) -> bool:
        """True if it looks the same from all sides."""
        return self in (Shape.CYLINDER, Shape.VESSEL, Shape.SPHERE)

    @property
    def numbers(self) -> int:
        """Number of values in a size."""
        if self in (Shape.CYLINDER, Shape.VESSEL, Shape.PLANE):
            return 2
        return 1 if self is Shape.SPHERE else 3


class Attachment(Enum):
    """Body to which an object is fixed."""

    HAND = "hand"
    """The object moves with the hand, whatever the fingers do, and counts as a part of it."""
    WORLD = "world"
    """The object stays where it is."""


class Zone(Enum):
    """Rule for the arm in the space of an object that is no body: all else passes through it."""

    NONE = "none"
    """The object is a body."""
    KEEP_OUT = "keep_out"
    """The arm and what it carries keep clear of it."""
    SLOW = "slow"
    """The tool moves slowly while a part of the arm is in it."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object that stands on z = 0 of its own frame.

    Attributes:
        name: unique among objects and links.
        shape, size: see ``Shape``.
        T: (4, 4) its pose in the base frame; in the frame of the hand while it is carried.
        can_be_held: whether the fingers may touch it, and hold it between both sides.
        held: whether the fingers hold it.
        solid: the solid of a mesh; None for other shapes.
        scale: factor on ``size``.
        appearance: how it is drawn.
        fixed: whether it is fixed to the hand.
        zone: its rule for the arm, if it is no body.
        joint: the joint on which it moves; None for other objects.
        crush_force: largest force of the fingers of one side that it bears [N]; None for any.
    """

    name: str
    shape: Shape
    size: tuple[float, ...]
    T: FloatArray
    can_be_held: bool = False
    held: bool = False
    solid: Solid | None = None
    scale: float = 1.0
    appearance: ObjectAppearance = PLAIN
    fixed: bool = False
    zone: Zone = Zone.NONE
    joint: ObjectJoint | None = None
    crush_force: float | None = None

    def __post_init__(self) -> None:
        if not (self.name.isprintable() and 0 < len(self.name) <= MAX_NAME_LENGTH):
            raise InputError(
                f"An object's name must have 1 to {MAX_NAME_LENGTH} printable characters."
            )
        what = f"The size of {self.name!r}"
        if (self.solid is not None) is not (self.shape is Shape.MESH):
            raise InputError(f"{self.name!r}: a mesh must have a solid, other shapes none.")
        if self.solid is not None:
            object.__setattr__(self, "size", self.solid.size)
        size = finite_array(self.size, (self.shape.numbers,), what)
        if not MIN_SCALE <= self.scale <= MAX_SCALE:
            raise InputError(
                f"The scale of {self.name!r} must be from {MIN_SCALE:g} to {MAX_SCALE:g}, "
                f"not {self.scale:g}."
            )
        # A mesh may be flat.
        minimum = size.max() if self.shape is Shape.MESH else size.min()
        slack = ROUNDING if self.shape is Shape.MESH else 0.0
        longest = self.scale * float(size.max())
        smallest = self.scale * float(minimum)
        if smallest < MIN_SIZE * (1.0 - slack) or longest > MAX_SIZE * (1.0 + slack):
            actual = " by ".join(
                digits_beyond(self.scale * length, MIN_SIZE, MAX_SIZE)
                if not MIN_SIZE <= self.scale * length <= MAX_SIZE
                else f"{self.scale * length:.4g}"
                for length in size.tolist()
            )
            hint = " Change its scale." if self.shape is Shape.MESH else ""
            raise InputError(
                f"{what} must be from {MIN_SIZE} to {MAX_SIZE:g} m, not {actual}.{hint}"
            )
        object.__setattr__(self, "size", tuple(size.tolist()))
        if self.fixed and self.held:
            raise InputError(f"{self.name!r} must be either fixed to the hand or held by it.")
        if self.is_zone and (self.carried or self.can_be_held or self.shape is Shape.VESSEL):
            raise InputError(
                f"{self.name!r} is a zone, so the hand cannot hold it and it is no vessel."
            )
        if self.shape is Shape.PLANE and not self.is_zone:
            raise InputError(f"{self.name!r} is a plane, so it must be a zone.")
        if self.crush_force is not None and not 0.0 < self.crush_force <= MAX_CRUSH_FORCE:
            raise InputError(
                f"The force that {self.name!r} bears must be over 0 and at most "
                f"{MAX_CRUSH_FORCE:g} N, not {self.crush_force:g}."
            )
        is_part = self.shape is not Shape.VESSEL and not (self.fixed or self.is_zone)
        if self.joint is not None and not is_part:
            raise InputError(
                f"{self.name!r} is on a joint, so it is no zone, no vessel and not fixed to the "
                "hand."
            )
        T = frozen(se3.validated(self.T, f"The pose of {self.name!r}"))
        if np.abs(T[:3, 3]).max() > MAX_COORDINATE:
            raise InputError(f"{self.name!r} would be more than {MAX_COORDINATE:g} m away.")
        object.__setattr__(self, "T", T)

    @property
    def is_zone(self) -> bool:
        """True if the object is no body."""
        return self.zone is not Zone.NONE

    @property
    def carried(self) -> bool:
        """True if the object moves with the hand."""
        return self.held or self.fixed

    @property
    def can_be_moved(self) -> bool:
        """True if people can put it elsewhere: the hand does not carry it, and it has no joint."""
        return not self.carried and self.joint is None

    @property
    def extent(self) -> tuple[float, ...]:
        """The size with the scale applied [m]."""
        return tuple(self.scale * length for length in self.size)

    @property
    def height(self) -> float:
        """Height [m]; that of a plane is below its frame."""
        if self.shape is Shape.PLANE:
            return -PLANE_DEPTH
        return 2.0 * self.extent[0] if self.shape is Shape.SPHERE else self.extent[-1]

    @property
    def collision_shape(self) -> CollisionShape:
        """Shape for collision checks, about the middle of the object."""
        if self.solid is not None:
            return _hull(self.solid.corners.tobytes(), self.scale, 0.5 * self.height)
        return _simple_shape(self.shape, self.extent)

    @property
    def T_collision_shape(self) -> FloatArray:
        """Pose (4, 4) of the middle of the object, in the frame of ``T``."""
        up = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5 * self.height))
        return self.T @ up


# Cached because an object that moves is created again at every step.
@lru_cache(maxsize=2 * MAX_OBJECTS)
def _simple_shape(shape: Shape, extent: tuple[float, ...]) -> CollisionShape:
    """Return a box, cylinder or ball about its middle."""
    match shape:
        case Shape.BOX:
            return box(extent)
        case Shape.SPHERE:
            return sphere(extent[0])
        case Shape.PLANE:
            return box((2.0 * PLANE_DEPTH, 2.0 * PLANE_DEPTH, PLANE_DEPTH))
    return cylinder(*extent)


@lru_cache(maxsize=2 * MAX_OBJECTS)
def _hull(corners: bytes, scale: float, middle: float) -> CollisionShape:
    """Return the hull of a solid about its middle."""
    points = scale * np.frombuffer(corners).reshape(-1, 3)
    return hull(points - (0.0, 0.0, middle))


def same(some: tuple[SceneObject, ...], others: tuple[SceneObject, ...]) -> bool:
    """Return whether both tuples have the same objects in the same places."""
    return len(some) == len(others) and all(
        _properties(a) == _properties(b) and np.array_equal(a.T, b.T)
        for a, b in zip(some, others, strict=True)
    )


def _properties(scene_object: SceneObject) -> tuple[object, ...]:
    """Return all properties of the object except its pose."""
    key = None if scene_object.solid is None else scene_object.solid.key
    kind = (scene_object.name, scene_object.shape, scene_object.size, scene_object.scale, key)
    flags = scene_object.can_be_held, scene_object.held, scene_object.fixed, scene_object.zone
    joint = None if scene_object.joint is None else scene_object.joint.key
    return (*kind, *flags, scene_object.appearance, joint, scene_object.crush_force)


def placed(objects: tuple[SceneObject, ...], scene_object: SceneObject) -> tuple[SceneObject, ...]:
    """Return ``objects`` with ``scene_object`` in place of the one of its name.

    An object with a new name is added if there is room. A held object stays, and one on a joint
    stays where it is.
    """
    known = named(objects, scene_object.name)
    if known is None:
        return (*objects, scene_object) if len(objects) < MAX_OBJECTS else objects
    if known.joint is not None and not scene_object.held:
        scene_object = replace(scene_object, T=known.T, joint=known.joint)
    return tuple(
        scene_object if other.name == scene_object.name and not other.held else other
        for other in objects
    )


def named(objects: Sequence[SceneObject], name: str) -> SceneObject | None:
    """Return the object of that name; None if there is none."""
    return next((scene_object for scene_object in objects if scene_object.name == name), None)


def with_replaced(
    objects: tuple[SceneObject, ...], wanted: tuple[SceneObject, ...]
) -> tuple[SceneObject, ...]:
    """Return ``wanted`` in place of ``objects``; held objects stay."""
    held = tuple(scene_object for scene_object in objects if scene_object.held)
    names = {scene_object.name for scene_object in held}
    left = tuple(scene_object for scene_object in wanted if scene_object.name not in names)
    return (*held, *left)[:MAX_OBJECTS]
