"""What stands around the arm and can be put elsewhere, and what its gripper holds of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

import numpy as np

from katana450.arm.control.solid import PLAIN, Look, Solid
from katana450.errors import InputError, digits_beyond
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.shape import Shape, box, cylinder, hull, sphere
from katana450.maths.collision.world import Part, World, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.water.environment import Table

MOST = 24
"""Things at a time."""

FARTHEST = 2.0
"""[m] Along any axis, from the base."""

LARGEST, SMALLEST = 2.0, 1e-3
"""[m] Of a thing, along any of its sides."""

ROUNDING = 1e-6
"""[1] Of a bound: what single precision makes of the length of a mesh that is on it."""

LEAST_SCALE, MOST_SCALE = 1e-3, 1e3

LONGEST_NAME = 40


class Form(Enum):
    """What a thing counts as where contacts are looked for; ``size`` [m] is of a form its own."""

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
        return {Form.BOX: 3, Form.CYLINDER: 2, Form.SPHERE: 1, Form.MESH: 3}[self]


class Mount(Enum):
    """What a thing is fixed to."""

    HAND = "hand"
    """It goes with the hand, whatever the fingers do, and counts as a part of it."""
    WORLD = "world"
    """It stays where it is."""
    TABLE = "table"
    """Likewise, once it is put down upright on the table below."""


@dataclass(frozen=True, eq=False)
class Thing:
    """Something that stands on z = 0 of a frame of its own.

    Attributes:
        name: no other thing or link has it.
        form, size: see ``Form``.
        T: (4, 4) where it stands, in the base frame; while it is carried, in that of the hand.
        can_be_held: whether the fingers may touch it, and take it when both do.
        held: whether they have.
        solid: of a mesh; None of any other form.
        scale: how many times as large it is as its size says.
        look: how it is drawn.
        fixed: whether it is fixed to the hand.
    """

    name: str
    form: Form
    size: tuple[float, ...]
    T: FloatArray
    can_be_held: bool = False
    held: bool = False
    solid: Solid | None = None
    scale: float = 1.0
    look: Look = PLAIN
    fixed: bool = False

    def __post_init__(self) -> None:
        if not (self.name.isprintable() and 0 < len(self.name) <= LONGEST_NAME):
            raise InputError(f"A thing's name has 1 to {LONGEST_NAME} characters to be printed.")
        what = f"The size of {self.name!r}"
        if (self.solid is not None) is not (self.form is Form.MESH):
            raise InputError(f"{self.name!r}: a mesh, and nothing else, has a solid.")
        if self.solid is not None:
            object.__setattr__(self, "size", self.solid.size)
        size = finite_array(self.size, (self.form.numbers,), what)
        if not LEAST_SCALE <= self.scale <= MOST_SCALE:
            raise InputError(
                f"The scale of {self.name!r} is from {LEAST_SCALE:g} to {MOST_SCALE:g}, "
                f"not {self.scale:g}."
            )
        # A mesh may be flat.
        least = size.max() if self.form is Form.MESH else size.min()
        slack = ROUNDING if self.form is Form.MESH else 0.0
        longest = self.scale * float(size.max())
        smallest = self.scale * float(least)
        if smallest < SMALLEST * (1.0 - slack) or longest > LARGEST * (1.0 + slack):
            said = " by ".join(
                digits_beyond(self.scale * each, SMALLEST, LARGEST)
                if not SMALLEST <= self.scale * each <= LARGEST
                else f"{self.scale * each:.4g}"
                for each in size.tolist()
            )
            raise InputError(f"{what} has to be from {SMALLEST} to {LARGEST:g} m, not {said}.")
        object.__setattr__(self, "size", tuple(size.tolist()))
        if self.fixed and self.held:
            raise InputError(f"{self.name!r} is either fixed to the hand or held by it.")
        T = frozen(se3.validated(self.T, f"The pose of {self.name!r}"))
        if np.abs(T[:3, 3]).max() > FARTHEST:
            raise InputError(f"{self.name!r} would be more than {FARTHEST:g} m away.")
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
        return 2.0 * self.extent[0] if self.form is Form.SPHERE else self.extent[-1]

    @property
    def shape(self) -> Shape:
        """About its middle."""
        match self.form:
            case Form.BOX:
                return box(self.extent)
            case Form.CYLINDER:
                return cylinder(*self.extent)
            case Form.SPHERE:
                return sphere(self.extent[0])
        assert self.solid is not None
        return _hull(self.solid.corners.tobytes(), self.scale, 0.5 * self.height)

    @property
    def T_shape(self) -> FloatArray:
        """(4, 4) its middle, in the frame of ``T``."""
        up = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5 * self.height))
        return self.T @ up


@lru_cache(maxsize=2 * MOST)
def _hull(corners: bytes, scale: float, middle: float) -> Shape:
    """Of a solid. Kept, for a thing that is dragged is made anew at every step."""
    points = scale * np.frombuffer(corners).reshape(-1, 3)
    return hull(points - (0.0, 0.0, middle))


def same(some: tuple[Thing, ...], others: tuple[Thing, ...]) -> bool:
    """Whether they are the same things in the same places."""
    return len(some) == len(others) and all(
        _told(a) == _told(b) and np.array_equal(a.T, b.T) for a, b in zip(some, others, strict=True)
    )


def _told(thing: Thing) -> tuple[object, ...]:
    """All of it but where it is."""
    key = None if thing.solid is None else thing.solid.key
    kind = (thing.name, thing.form, thing.size, thing.scale, key)
    return (*kind, thing.can_be_held, thing.held, thing.fixed, thing.look)


def placed(things: tuple[Thing, ...], thing: Thing) -> tuple[Thing, ...]:
    """``things`` with ``thing`` in place of the one of its name, or as one more if there is room.

    What is held stays.
    """
    known = [each.name for each in things]
    if thing.name not in known:
        return (*things, thing) if len(things) < MOST else things
    return tuple(thing if each.name == thing.name and not each.held else each for each in things)


def named(things: Sequence[Thing], name: str) -> Thing | None:
    """The one of that name."""
    return next((each for each in things if each.name == name), None)


def furnished_with(things: tuple[Thing, ...], wanted: tuple[Thing, ...]) -> tuple[Thing, ...]:
    """``wanted`` in place of ``things``, of which what is held stays."""
    held = tuple(each for each in things if each.held)
    names = {each.name for each in held}
    left = tuple(each for each in wanted if each.name not in names)
    return (*held, *left)[:MOST]


@dataclass(frozen=True, eq=False)
class Hand:
    """What the arm takes things with.

    palm: the piece of the linkage that fingers hang on, the last of the arm where it has none.
    fingers: their names among the parts. T_palm_tool: (4, 4) the frame of the default tool in that
    of the palm. slides: whether the fingers slide instead of turning.
    """

    palm: int
    fingers: tuple[str, ...]
    T_palm_tool: FloatArray
    slides: bool = False


class Environment:
    """The world for any things that stand around, and where these are."""

    def __init__(self, world: World | None, hand: Hand | None, table: Table | None = None) -> None:
        """``world``: the arm, and what cannot be moved. ``hand``: None where nothing is held.

        ``table``: what things stand on; None where that is not judged.
        """
        self._world = world
        self.hand = hand
        self.table = table

    def world(self, things: Sequence[Thing]) -> World | None:
        """With ``things``; None where nothing is looked at."""
        if self._world is None:
            return None
        standing = [
            obstacle(thing.name, thing.T_shape, thing.shape)
            for thing in things
            if not thing.carried
        ]
        world = self._world.with_obstacles(standing) if standing else self._world
        for thing in things:
            if thing.carried and self.hand is not None:
                part = Part(thing.name, self.hand.palm, (frozen(thing.T_shape),), (thing.shape,))
                world = world.with_carried(part)
        return world

    def touch(self, world: World, things: Sequence[Thing]) -> FloatArray:
        """(p,) how far apart each pair of ``world`` stays while the fingers move [m]."""
        holdable = {thing.name for thing in things if thing.can_be_held and not thing.carried}
        fingers = set(() if self.hand is None else self.hand.fingers)
        names = [world.parts[number].name for number in world.part_of.tolist()]
        touching = [
            bool({names[a], names[b]} & holdable and {names[a], names[b]} & fingers)
            for a, b in zip(world.first.tolist(), world.second.tolist(), strict=True)
        ]
        return np.where(touching, 0.0, STOP)

    def pose(self, thing: Thing, x: FloatArray) -> FloatArray:
        """(4, 4) of ``thing`` in the base frame, at ``x`` (k,): joints and finger joint [rad]."""
        return thing.T if not thing.carried else self._palm(x) @ thing.T

    def taken(self, thing: Thing, x: FloatArray) -> Thing:
        """``thing`` in the hand, where it is."""
        return replace(thing, T=self.into_hand(thing.T, x), held=True)

    def into_hand(self, T: FloatArray, x: FloatArray) -> FloatArray:
        """``T`` (4, 4) in the base frame, in that of the hand at ``x`` (k,)."""
        return se3.inverse(self._palm(x)) @ T

    def mounted(self, thing: Thing, to: Mount, x: FloatArray) -> Thing:
        """``thing`` fixed to the hand, or to it no more. What the fingers hold stays with them."""
        if thing.held or (to is Mount.HAND and (thing.fixed or self.hand is None)):
            return thing
        if to is Mount.HAND:
            return replace(thing, T=self.into_hand(thing.T, x), fixed=True)
        if to is Mount.TABLE:
            return self.left(thing, x)
        return replace(thing, T=self.pose(thing, x), fixed=False)

    def left(self, thing: Thing, x: FloatArray) -> Thing:
        """``thing`` out of the hand: it comes down upright on the table below."""
        T = self.pose(thing, x)
        yaw = float(np.arctan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1]))
        at = (T[0, 3], T[1, 3], 0.0)
        T = se3.from_rotation_translation(so3.rotation_z(yaw), at)
        return replace(thing, T=T, held=False, fixed=False)

    def _palm(self, x: FloatArray) -> FloatArray:
        assert self._world is not None
        assert self.hand is not None
        return np.asarray(self._world.linkage.poses(x)[self.hand.palm])
