"""What stands around the arm and can be put elsewhere, and what its gripper holds of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

import numpy as np

from katana450.arm.control.solid import PLAIN, ObjectAppearance, Solid
from katana450.errors import InputError, digits_beyond
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.shape import CollisionShape, box, cylinder, hull, sphere
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.water.environment import TableTop

MAX_OBJECTS = 24
"""Objects at a time."""

MAX_COORDINATE = 2.0
"""[m] Along any axis, from the base."""

MAX_SIZE, MIN_SIZE = 2.0, 1e-3
"""[m] Of an object, along any of its sides."""

ROUNDING = 1e-6
"""[1] Of a bound: what single precision makes of the length of a mesh that is on it."""

MIN_SCALE, MAX_SCALE = 1e-3, 1e3

MAX_NAME_LENGTH = 40


class Shape(Enum):
    """What an object counts as where contacts are looked for; ``size`` [m] is of a form its own."""

    BOX = "box"
    """size: along x, y, z."""
    CYLINDER = "cylinder"
    """size: radius, height."""
    SPHERE = "sphere"
    """size: radius."""
    MESH = "mesh"
    """size: along x, y, z, of its solid."""

    @property
    def numbers(self) -> int:
        """How many a size has."""
        return {Shape.BOX: 3, Shape.CYLINDER: 2, Shape.SPHERE: 1, Shape.MESH: 3}[self]


class Attachment(Enum):
    """What an object is fixed to."""

    HAND = "hand"
    """It goes with the hand, whatever the fingers do, and counts as a part of it."""
    WORLD = "world"
    """It stays where it is."""
    TABLE = "table"
    """Likewise, once it is put down upright on the table below."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """Something that stands on z = 0 of a frame of its own.

    Attributes:
        name: no other thing or link has it.
        shape, size: see ``Shape``.
        T: (4, 4) where it stands, in the base frame; while it is carried, in that of the hand.
        can_be_held: whether the fingers may touch it, and take it when both do.
        held: whether they have.
        solid: of a mesh; None of any other form.
        scale: how many times as large it is as its size says.
        look: how it is drawn.
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
                f"An object's name has 1 to {MAX_NAME_LENGTH} characters to be printed."
            )
        what = f"The size of {self.name!r}"
        if (self.solid is not None) is not (self.shape is Shape.MESH):
            raise InputError(f"{self.name!r}: a mesh, and nothing else, has a solid.")
        if self.solid is not None:
            object.__setattr__(self, "size", self.solid.size)
        size = finite_array(self.size, (self.shape.numbers,), what)
        if not MIN_SCALE <= self.scale <= MAX_SCALE:
            raise InputError(
                f"The scale of {self.name!r} is from {MIN_SCALE:g} to {MAX_SCALE:g}, "
                f"not {self.scale:g}."
            )
        # A mesh may be flat.
        minimum = size.max() if self.shape is Shape.MESH else size.min()
        slack = ROUNDING if self.shape is Shape.MESH else 0.0
        longest = self.scale * float(size.max())
        smallest = self.scale * float(minimum)
        if smallest < MIN_SIZE * (1.0 - slack) or longest > MAX_SIZE * (1.0 + slack):
            said = " by ".join(
                digits_beyond(self.scale * each, MIN_SIZE, MAX_SIZE)
                if not MIN_SIZE <= self.scale * each <= MAX_SIZE
                else f"{self.scale * each:.4g}"
                for each in size.tolist()
            )
            raise InputError(f"{what} has to be from {MIN_SIZE} to {MAX_SIZE:g} m, not {said}.")
        object.__setattr__(self, "size", tuple(size.tolist()))
        if self.fixed and self.held:
            raise InputError(f"{self.name!r} is either fixed to the hand or held by it.")
        T = frozen(se3.validated(self.T, f"The pose of {self.name!r}"))
        if np.abs(T[:3, 3]).max() > MAX_COORDINATE:
            raise InputError(f"{self.name!r} would be more than {MAX_COORDINATE:g} m away.")
        object.__setattr__(self, "T", T)

    @property
    def carried(self) -> bool:
        """Whether it goes where the hand goes."""
        return self.held or self.fixed

    @property
    def extent(self) -> tuple[float, ...]:
        """Its size as large as it is [m]."""
        return tuple(self.scale * each for each in self.size)

    @property
    def height(self) -> float:
        """[m]"""
        return 2.0 * self.extent[0] if self.shape is Shape.SPHERE else self.extent[-1]

    @property
    def collision_shape(self) -> CollisionShape:
        """About its middle."""
        match self.shape:
            case Shape.BOX:
                return box(self.extent)
            case Shape.CYLINDER:
                return cylinder(*self.extent)
            case Shape.SPHERE:
                return sphere(self.extent[0])
        assert self.solid is not None
        return _hull(self.solid.corners.tobytes(), self.scale, 0.5 * self.height)

    @property
    def T_collision_shape(self) -> FloatArray:
        """(4, 4) its middle, in the frame of ``T``."""
        up = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5 * self.height))
        return self.T @ up


@lru_cache(maxsize=2 * MAX_OBJECTS)
def _hull(corners: bytes, scale: float, middle: float) -> CollisionShape:
    """Of a solid. Kept, for an object that is dragged is made anew at every step."""
    points = scale * np.frombuffer(corners).reshape(-1, 3)
    return hull(points - (0.0, 0.0, middle))


def same(some: tuple[SceneObject, ...], others: tuple[SceneObject, ...]) -> bool:
    """Whether they are the same things in the same places."""
    return len(some) == len(others) and all(
        _told(a) == _told(b) and np.array_equal(a.T, b.T) for a, b in zip(some, others, strict=True)
    )


def _told(scene_object: SceneObject) -> tuple[object, ...]:
    """All of it but where it is."""
    key = None if scene_object.solid is None else scene_object.solid.key
    kind = (scene_object.name, scene_object.shape, scene_object.size, scene_object.scale, key)
    return (
        *kind,
        scene_object.can_be_held,
        scene_object.held,
        scene_object.fixed,
        scene_object.appearance,
    )


def placed(objects: tuple[SceneObject, ...], scene_object: SceneObject) -> tuple[SceneObject, ...]:
    """``objects`` with ``scene_object`` in place of the one of its name, or as one more if there is
    room.

    What is held stays.
    """
    known = [each.name for each in objects]
    if scene_object.name not in known:
        return (*objects, scene_object) if len(objects) < MAX_OBJECTS else objects
    return tuple(
        scene_object if each.name == scene_object.name and not each.held else each
        for each in objects
    )


def named(objects: Sequence[SceneObject], name: str) -> SceneObject | None:
    """The one of that name."""
    return next((each for each in objects if each.name == name), None)


def with_replaced(
    objects: tuple[SceneObject, ...], wanted: tuple[SceneObject, ...]
) -> tuple[SceneObject, ...]:
    """``wanted`` in place of ``objects``, of which what is held stays."""
    held = tuple(each for each in objects if each.held)
    names = {each.name for each in held}
    left = tuple(each for each in wanted if each.name not in names)
    return (*held, *left)[:MAX_OBJECTS]


@dataclass(frozen=True, eq=False)
class Hand:
    """What the arm takes objects with.

    palm: the piece of the linkage that fingers hang on, the last of the arm where it has none.
    fingers: their names among the parts. T_palm_tool: (4, 4) the frame of the default tool in that
    of the palm. slides: whether the fingers slide instead of turning.
    """

    palm: int
    fingers: tuple[str, ...]
    T_palm_tool: FloatArray
    slides: bool = False


class Environment:
    """The world for any objects that stand around, and where these are."""

    def __init__(
        self, world: CollisionWorld | None, hand: Hand | None, table: TableTop | None = None
    ) -> None:
        """``world``: the arm, and what cannot be moved. ``hand``: None where nothing is held.

        ``table``: what objects stand on; None where that is not judged.
        """
        self._world = world
        self.hand = hand
        self.table = table

    def world(self, objects: Sequence[SceneObject]) -> CollisionWorld | None:
        """With ``objects``; None where nothing is looked at."""
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
        """(p,) how far apart each pair of ``world`` stays while the fingers move [m]."""
        holdable = {
            scene_object.name
            for scene_object in objects
            if scene_object.can_be_held and not scene_object.carried
        }
        fingers = set(() if self.hand is None else self.hand.fingers)
        names = [world.parts[number].name for number in world.part_of.tolist()]
        touching = [
            bool({names[a], names[b]} & holdable and {names[a], names[b]} & fingers)
            for a, b in zip(world.first.tolist(), world.second.tolist(), strict=True)
        ]
        return np.where(touching, 0.0, STOP)

    def pose(self, scene_object: SceneObject, x: FloatArray) -> FloatArray:
        """(4, 4) of ``scene_object`` in the base frame, at ``x`` (k,): joints and finger joint
        [rad].
        """
        return scene_object.T if not scene_object.carried else self._palm(x) @ scene_object.T

    def taken(self, scene_object: SceneObject, x: FloatArray) -> SceneObject:
        """``scene_object`` in the hand, where it is."""
        return replace(scene_object, T=self.into_hand(scene_object.T, x), held=True)

    def into_hand(self, T: FloatArray, x: FloatArray) -> FloatArray:
        """``T`` (4, 4) in the base frame, in that of the hand at ``x`` (k,)."""
        return se3.inverse(self._palm(x)) @ T

    def mounted(self, scene_object: SceneObject, to: Attachment, x: FloatArray) -> SceneObject:
        """``scene_object`` fixed to the hand, or to it no more. What the fingers hold stays with
        them.
        """
        if scene_object.held or (
            to is Attachment.HAND and (scene_object.fixed or self.hand is None)
        ):
            return scene_object
        if to is Attachment.HAND:
            return replace(scene_object, T=self.into_hand(scene_object.T, x), fixed=True)
        if to is Attachment.TABLE:
            return self.left(scene_object, x)
        return replace(scene_object, T=self.pose(scene_object, x), fixed=False)

    def left(self, scene_object: SceneObject, x: FloatArray) -> SceneObject:
        """``scene_object`` out of the hand: it comes down upright on the table below."""
        T = self.pose(scene_object, x)
        yaw = float(np.arctan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1]))
        at = (T[0, 3], T[1, 3], 0.0)
        T = se3.from_rotation_translation(so3.rotation_z(yaw), at)
        return replace(scene_object, T=T, held=False, fixed=False)

    def _palm(self, x: FloatArray) -> FloatArray:
        assert self._world is not None
        assert self.hand is not None
        return np.asarray(self._world.linkage.poses(x)[self.hand.palm])
