"""Any tree of links, joints and shapes, as files for other programs need it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

SLACK = 1e-9
"""[rad, m] By which a joint may seem to be beyond its limits."""


class Material(NamedTuple):
    """A surface: sRGB colour 0..1, glTF's factors metallic and rough 0..1."""

    name: str
    colour: tuple[float, float, float]
    metallic: float = 0.0
    rough: float = 0.6

    @property
    def gleam(self) -> float:
        """Grey of the highlight 0..1, in formats that know no metal: smooth metal has the most."""
        return (1.0 - self.rough) * (0.3 + 0.5 * self.metallic)


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles of one material.

    vertices, normals: (n, 3), [m] and of unit length, in the frame of their link. faces: (m, 3)
    indices of both, counter-clockwise seen from outside.
    """

    material: Material
    vertices: FloatArray
    normals: FloatArray
    faces: npt.NDArray[np.int64]

    @cached_property
    def area(self) -> float:
        """[m^2]"""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    @cached_property
    def corners(self) -> FloatArray:
        """(8, 3) of the box round it."""
        ends = (self.vertices.min(axis=0), self.vertices.max(axis=0))
        return np.array(list(itertools.product(*np.transpose(ends).tolist())))


PLAIN = (0.8, 0.8, 0.8)
"""The colour that VRML gives what says none."""


def main_colour(shapes: Sequence[Shape]) -> tuple[float, float, float]:
    """sRGB 0..1 of most of their surface; PLAIN where there are none."""
    areas: dict[Material, float] = {}
    for shape in shapes:
        areas[shape.material] = areas.get(shape.material, 0.0) + shape.area
    return max(areas, key=areas.__getitem__).colour if areas else PLAIN


@dataclass(frozen=True, eq=False)
class Joint:
    """What a link hangs on if it can move.

    Attributes:
        name: of the joint.
        slides: whether it is prismatic; else it turns.
        axis: (3,) unit direction in the frame of its link.
        lower, upper: limits [rad] or [m], infinite where there are none.
        leader: the joint whose value it follows, by its own name when it is driven itself.
        factor, offset: value = factor * leader + offset.
        speed: the most of it [rad/s] or [m/s], infinite where none is named.
    """

    name: str
    slides: bool
    axis: FloatArray
    lower: float
    upper: float
    leader: str
    factor: float = 1.0
    offset: float = 0.0
    speed: float = math.inf

    def motion(self, value: float) -> FloatArray:
        """(4, 4) that the joint adds at ``value`` of its own."""
        if self.slides:
            return se3.from_rotation_translation(np.eye(3), value * self.axis)
        return se3.from_rotation_translation(so3.exp(value * self.axis), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Link:
    """One link: name, parent (the root has none), T_parent_link (4, 4) at zero [m], its joint
    (None when fixed) and its shapes."""

    name: str
    parent: str | None
    T_parent_link: FloatArray
    joint: Joint | None
    shapes: tuple[Shape, ...]

    @cached_property
    def colour(self) -> tuple[float, float, float]:
        """sRGB 0..1 of most of its surface; PLAIN without shapes."""
        return main_colour(self.shapes)


@dataclass(frozen=True, eq=False)
class Mechanism:
    """The tree; its links stand parents first, and the first is the root."""

    name: str
    links: tuple[Link, ...]

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """Every movable joint by its name."""
        return {link.joint.name: link.joint for link in self.links if link.joint is not None}

    @cached_property
    def driven(self) -> tuple[str, ...]:
        """The joints that follow no other, in the order of the links."""
        return tuple(name for name, joint in self.joints.items() if joint.leader == name)

    def children(self, link: Link) -> tuple[Link, ...]:
        """The links that hang on it."""
        return tuple(other for other in self.links if other.parent == link.name)

    @cached_property
    def home(self) -> Mapping[str, FloatArray]:
        """(4, 4) of each link in the root at zero, where every joint adds nothing."""
        return self.frames({})

    def axis(self, joint: Joint) -> FloatArray:
        """(3,) unit direction of ``joint`` in the root's frame at zero."""
        link = next(link for link in self.links if link.joint is joint)
        return self.home[link.name][:3, :3] @ joint.axis

    def values(self, pose: Sequence[float]) -> dict[str, float]:
        """The value of every joint [rad] or [m] for those of the first driven ones.

        Driven joints that `pose` is too short for stay at zero, or at the limit next to it.
        Raises InputError for more numbers than joints, no numbers, and values beyond the limits.
        """
        driven = self.driven
        if len(pose) > len(driven):
            raise InputError(
                f"A pose of {self.name} has at most {len(driven)} numbers "
                f"({', '.join(driven)}), not {len(pose)}."
            )
        numbers = finite_array(pose, (len(pose),), "The pose").tolist()
        given = dict(zip(driven, numbers, strict=False))
        for name, value in given.items():
            self.check(name, value)
        return self.every(given)

    def check(self, name: str, value: float) -> None:
        """InputError when `value` [rad] or [m] is beyond the limits of the driven joint `name`."""
        joint = self.joints[name]
        if not joint.lower - SLACK <= value <= joint.upper + SLACK:
            unit = "m" if joint.slides else "rad"
            raise InputError(
                f"{name} cannot be at {value:g} {unit}; "
                f"it goes from {joint.lower:g} to {joint.upper:g} {unit}."
            )

    def every(self, given: Mapping[str, float]) -> dict[str, float]:
        """The value of every joint, from those of some driven ones."""
        leaders = {name: self.joints[name] for name in self.driven}
        at = {
            name: given.get(name, min(max(0.0, joint.lower), joint.upper))
            for name, joint in leaders.items()
        }
        return {
            name: joint.factor * at[joint.leader] + joint.offset
            for name, joint in self.joints.items()
        }

    def frames(self, values: Mapping[str, float]) -> dict[str, FloatArray]:
        """(4, 4) of each link in the root; joints without a value add nothing."""
        found: dict[str, FloatArray] = {}
        for link in self.links:
            T = link.T_parent_link
            if link.parent is not None:
                T = found[link.parent] @ T
            if link.joint is not None and link.joint.name in values:
                T = T @ link.joint.motion(values[link.joint.name])
            found[link.name] = frozen(T)
        return found

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) [m] of all shapes in the root.

        At zero, and with one driven joint at a limit or between both.
        """
        poses = [self.every({})]
        for name in self.driven:
            joint = self.joints[name]
            ends = [max(joint.lower, -QUARTER), min(joint.upper, QUARTER)]
            poses += [self.every({name: value}) for value in (*ends, sum(ends) / 2.0)]
        corners = [np.zeros((1, 3))]
        for frames in map(self.frames, poses):
            for link in self.links:
                T = frames[link.name]
                corners += [shape.corners @ T[:3, :3].T + T[:3, 3] for shape in link.shapes]
        points = np.concatenate(corners)
        return points.min(axis=0), points.max(axis=0)


QUARTER = math.pi / 2.0
"""[rad, m] As far as a joint is moved to see how much room a mechanism takes."""

FIELD_OF_VIEW = math.radians(40.0)
"""Of the cameras that files come with, between the top and the bottom of a picture."""

LOOKING = (-0.55, 0.75, -0.37)
"""The direction they look in, in the root's frame."""


CLOSE = 0.7
"""Of the distance at which a ball round all of it would fill the picture; nothing fills that."""


class Camera(NamedTuple):
    """Where a picture is taken from: eye and target (3,) in the root's frame [m]; z is up."""

    eye: FloatArray
    target: FloatArray


def camera(mechanism: Mechanism) -> Camera:
    """One that sees the mechanism whole in its common poses."""
    low, high = mechanism.bounds
    target = (low + high) / 2.0
    radius = max(float(np.linalg.norm(high - low)) / 2.0, 1e-3)
    way = np.array(LOOKING) / float(np.linalg.norm(LOOKING))
    return Camera(target - way * CLOSE * radius / math.sin(FIELD_OF_VIEW / 2.0), target)
