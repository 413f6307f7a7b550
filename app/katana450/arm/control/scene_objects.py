"""Objects around the arm that can be moved, and the objects that its gripper holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from katana450.arm.control.gripper_model import GripperModel
from katana450.arm.control.solid import PLAIN, ObjectAppearance, Solid
from katana450.caching import cached_property
from katana450.errors import InputError, digits_beyond
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.shape import CollisionShape, box, cylinder, hull, sphere
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.water.environment import TableTop

if TYPE_CHECKING:
    from katana450.arm.control.state import State
    from katana450.maths.collision.world import CollisionWorld


class GripModel(Protocol):
    """Forces between the fingers and the object that they hold. All methods are pure."""

    def overload(self, state: State) -> float | None:
        """Return the load [N] under which the held object slides; None if the fingers hold it."""

    def slid(self, state: State, dt: float) -> SceneObject | None:
        """Return the held object after it has slid for ``dt`` [s]; None if it leaves the fingers.

        ``state`` has an overload.
        """

    def report(self, state: State) -> Mapping[str, Any]:
        """Return forces, pressures and sensor values of ``state`` for the answer to a query."""


class FixedJawModel(Protocol):
    """A fixed jaw, against which the moving jaw pushes objects. Its method is pure."""

    def met(
        self, world: CollisionWorld, state: State, item: SceneObject
    ) -> tuple[str, float, SceneObject | None]:
        """Return the name of the fixed jaw, its distance [m] from ``item``, and the pushed object.

        ``item`` touches the moving jaw. The pushed object is in the base frame, nearer to the fixed
        jaw. It is None if it touches the jaw already, is not before its face, or cannot be pushed:
        uphill, or into another object.
        """


MAX_OBJECTS = 64
"""Maximum number of objects at a time."""

MAX_COORDINATE = 2.0
"""[m] Maximum distance of an object from the base along any axis."""

MAX_SIZE, MIN_SIZE = 2.0, 1e-3
"""[m] Bounds of the size of an object along any of its sides."""

ROUNDING = 1e-6
"""[1] Tolerance of a bound, for the size of a mesh in single precision."""

MIN_SCALE, MAX_SCALE = 1e-3, 1e3

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

    @property
    def is_round(self) -> bool:
        """True if it looks the same from all sides."""
        return self in (Shape.CYLINDER, Shape.VESSEL, Shape.SPHERE)

    @property
    def numbers(self) -> int:
        """Number of values in a size."""
        if self in (Shape.CYLINDER, Shape.VESSEL):
            return 2
        return 1 if self is Shape.SPHERE else 3


class Attachment(Enum):
    """Body to which an object is fixed."""

    HAND = "hand"
    """The object moves with the hand, whatever the fingers do, and counts as a part of it."""
    WORLD = "world"
    """The object stays where it is."""
    TABLE = "table"
    """The object is put down upright on the table below, and stays there."""


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
                digits_beyond(self.scale * each, MIN_SIZE, MAX_SIZE)
                if not MIN_SIZE <= self.scale * each <= MAX_SIZE
                else f"{self.scale * each:.4g}"
                for each in size.tolist()
            )
            hint = " Change its scale." if self.shape is Shape.MESH else ""
            raise InputError(
                f"{what} must be from {MIN_SIZE} to {MAX_SIZE:g} m, not {actual}.{hint}"
            )
        object.__setattr__(self, "size", tuple(size.tolist()))
        if self.fixed and self.held:
            raise InputError(f"{self.name!r} must be either fixed to the hand or held by it.")
        T = frozen(se3.validated(self.T, f"The pose of {self.name!r}"))
        if np.abs(T[:3, 3]).max() > MAX_COORDINATE:
            raise InputError(f"{self.name!r} would be more than {MAX_COORDINATE:g} m away.")
        object.__setattr__(self, "T", T)

    @property
    def carried(self) -> bool:
        """True if the object moves with the hand."""
        return self.held or self.fixed

    @property
    def extent(self) -> tuple[float, ...]:
        """The size with the scale applied [m]."""
        return tuple(self.scale * each for each in self.size)

    @property
    def height(self) -> float:
        """Height [m]."""
        return 2.0 * self.extent[0] if self.shape is Shape.SPHERE else self.extent[-1]

    @property
    def collision_shape(self) -> CollisionShape:
        """Shape for collision checks, about the middle of the object."""
        match self.shape:
            case Shape.BOX:
                return box(self.extent)
            case Shape.CYLINDER | Shape.VESSEL:
                return cylinder(*self.extent)
            case Shape.SPHERE:
                return sphere(self.extent[0])
        assert self.solid is not None
        return _hull(self.solid.corners.tobytes(), self.scale, 0.5 * self.height)

    @property
    def T_collision_shape(self) -> FloatArray:
        """Pose (4, 4) of the middle of the object, in the frame of ``T``."""
        up = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5 * self.height))
        return self.T @ up


@lru_cache(maxsize=2 * MAX_OBJECTS)
def _hull(corners: bytes, scale: float, middle: float) -> CollisionShape:
    """Return the hull of a solid about its middle.

    Cached because an object that is dragged is created again at every step.
    """
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
    flags = scene_object.can_be_held, scene_object.held, scene_object.fixed
    return (*kind, *flags, scene_object.appearance)


def placed(objects: tuple[SceneObject, ...], scene_object: SceneObject) -> tuple[SceneObject, ...]:
    """Return ``objects`` with ``scene_object`` in place of the one of its name.

    An object with a new name is added if there is room. A held object stays.
    """
    known = [each.name for each in objects]
    if scene_object.name not in known:
        return (*objects, scene_object) if len(objects) < MAX_OBJECTS else objects
    return tuple(
        scene_object if each.name == scene_object.name and not each.held else each
        for each in objects
    )


def named(objects: Sequence[SceneObject], name: str) -> SceneObject | None:
    """Return the object of that name; None if there is none."""
    return next((each for each in objects if each.name == name), None)


def with_replaced(
    objects: tuple[SceneObject, ...], wanted: tuple[SceneObject, ...]
) -> tuple[SceneObject, ...]:
    """Return ``wanted`` in place of ``objects``; held objects stay."""
    held = tuple(each for each in objects if each.held)
    names = {each.name for each in held}
    left = tuple(each for each in wanted if each.name not in names)
    return (*held, *left)[:MAX_OBJECTS]


@dataclass(frozen=True, eq=False)
class Hand:
    """The part of the arm that takes objects.

    Attributes:
        palm: index of the body in the linkage that carries the fingers; the last body of an arm
            without fingers.
        fingers: names of the fingers among the parts.
        T_palm_tool: (4, 4) the frame of the default tool in the frame of the palm.
        gripper: the finger joint.
        sides: names of the fingers on each side of an object, those at the tips first.
        fixed_jaw: the body of the palm against which a single side closes; None for two.
        grip_model: the forces in the hand; None if they are not modelled, and objects never slip.
    """

    palm: int
    fingers: tuple[str, ...]
    T_palm_tool: FloatArray
    gripper: GripperModel
    sides: tuple[tuple[str, ...], ...]
    fixed_jaw: FixedJawModel | None = None
    grip_model: GripModel | None = None

    @property
    def can_hold(self) -> bool:
        """True if it has two sides, between which objects are held."""
        return len(self.sides) + (self.fixed_jaw is not None) >= 2


class Environment:
    """Collision world of the arm with any objects, and the poses of these objects."""

    def __init__(
        self, world: CollisionWorld | None, hand: Hand | None, table: TableTop | None = None
    ) -> None:
        """Create the environment.

        Args:
            world: the arm and all fixed bodies; None to check no contacts.
            hand: the hand; None if nothing can be held.
            table: the support of the objects; None if their support is not checked.
        """
        self._world = world
        self.hand = hand
        self.table = table

    @cached_property
    def table_height(self) -> float:
        """Height of the table in the base frame [m]."""
        parts = () if self._world is None else self._world.parts
        tables = [each.T_mover_shape[0][2, 3] for each in parts if each.name == "table"]
        return float(tables[0]) if tables else 0.0

    def world(self, objects: Sequence[SceneObject]) -> CollisionWorld | None:
        """Return the collision world with ``objects``; None if contacts are not checked."""
        if self._world is None:
            return None
        standing = [
            obstacle(
                scene_object.name, scene_object.T_collision_shape, scene_object.collision_shape
            )
            for scene_object in objects
            if not scene_object.carried
        ]
        world = self._world.with_obstacles(standing) if standing else self._world
        for scene_object in objects:
            if scene_object.carried and self.hand is not None:
                part = Part(
                    scene_object.name,
                    self.hand.palm,
                    (frozen(scene_object.T_collision_shape),),
                    (scene_object.collision_shape,),
                )
                world = world.with_carried(part)
        return world

    def touch(self, world: CollisionWorld, objects: Sequence[SceneObject]) -> FloatArray:
        """Return the minimum distance (p,) of each pair of ``world`` while the fingers move [m]."""
        holdable = {each.name for each in objects if each.can_be_held and not each.carried}
        fingers = set(self.hand.fingers if self.hand is not None and self.hand.can_hold else ())
        names = [world.parts[number].name for number in world.part_of.tolist()]
        touching = [
            bool({names[a], names[b]} & holdable and {names[a], names[b]} & fingers)
            for a, b in zip(world.first.tolist(), world.second.tolist(), strict=True)
        ]
        return np.where(touching, 0.0, STOP)

    def pose(self, scene_object: SceneObject, x: FloatArray) -> FloatArray:
        """Return the pose (4, 4) of ``scene_object`` in the base frame.

        x: (k,) joints and finger joint [rad].
        """
        return scene_object.T if not scene_object.carried else self._palm(x) @ scene_object.T

    def taken(self, scene_object: SceneObject, x: FloatArray) -> SceneObject:
        """Return ``scene_object`` as held by the hand, at the place where it is."""
        return replace(scene_object, T=self.into_hand(scene_object.T, x), held=True)

    def into_hand(self, T: FloatArray, x: FloatArray) -> FloatArray:
        """Return the pose ``T`` (4, 4), given in the base frame, in the frame of the hand.

        x: (k,) joints and finger joint [rad].
        """
        return se3.inverse(self._palm(x)) @ T

    def mounted(self, scene_object: SceneObject, to: Attachment, x: FloatArray) -> SceneObject:
        """Return ``scene_object`` fixed to ``to``. An object that the fingers hold is unchanged.

        x: (k,) joints and finger joint [rad].
        """
        if scene_object.held or (
            to is Attachment.HAND and (scene_object.fixed or self.hand is None)
        ):
            return scene_object
        if to is Attachment.HAND:
            return replace(scene_object, T=self.into_hand(scene_object.T, x), fixed=True)
        if to is Attachment.TABLE:
            return self.left(scene_object, x, self.table_height)
        return replace(scene_object, T=self.pose(scene_object, x), fixed=False)

    def left(self, scene_object: SceneObject, x: FloatArray, height: float = 0.0) -> SceneObject:
        """Return ``scene_object`` released from the hand, upright on what carries it.

        x: (k,) joints and finger joint [rad].
        height: of the surface below it [m].
        """
        T = self.pose(scene_object, x)
        yaw = float(np.arctan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1]))
        at = (T[0, 3], T[1, 3], height)
        T = se3.from_rotation_translation(so3.rotation_z(yaw), at)
        return replace(scene_object, T=T, held=False, fixed=False)

    def _palm(self, x: FloatArray) -> FloatArray:
        assert self._world is not None
        assert self.hand is not None
        return np.asarray(self._world.linkage.poses(x)[self.hand.palm])
