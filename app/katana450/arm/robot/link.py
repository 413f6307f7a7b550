"""A link of a robot and the joint that connects it to its parent."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from katana450.arm.robot.surfaces import VisualMesh, main_colour, shapes_of
from katana450.arm.robot.urdf import Inertial
from katana450.arm.robot.visual import Visual
from katana450.caching import cached_property
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

SLOW_TURN, SLOW_SLIDE = 1.0, 0.1
"""[rad/s, m/s] Speed of a joint if its file states none."""


@dataclass(frozen=True, eq=False)
class Joint:
    """The movable connection of a link to its parent.

    Attributes:
        name: of the joint.
        slides: whether it is prismatic; else it turns.
        axis: (3,) unit direction in the frame of its link.
        lower, upper: limits [rad] or [m], infinite if there are none.
        leader: the joint whose value it follows; its own name if it is driven itself.
        factor, offset: value = factor * leader + offset.
        speed: maximum [rad/s] or [m/s], infinite if the file states none.
        effort: maximum force [N m] or [N], 0 if the file states none.
        damping, friction: [N m s/rad, N s/m] and [N m, N], 0 if the file states none.
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
    effort: float = 0.0
    damping: float = 0.0
    friction: float = 0.0

    def motion(self, value: float) -> FloatArray:
        """Return the pose (4, 4) that the joint adds at ``value`` [rad] or [m]."""
        if self.slides:
            return se3.from_rotation_translation(np.eye(3), value * self.axis)
        return se3.from_rotation_translation(so3.exp(value * self.axis), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body of a robot.

    Attributes:
        name: of the link.
        parent: name of its parent link; None for the root.
        T_parent_link: (4, 4) pose in its parent at zero [m].
        joint: None if it is fixed.
        visuals: its shapes as the file has them.
        collisions: the shapes that represent it in collision checks.
        inertial: its mass, if the file states one.
        missing: the mesh files of its visuals, and of its collisions, that do not exist.
    """

    name: str
    parent: str | None
    T_parent_link: FloatArray
    joint: Joint | None
    visuals: tuple[Visual, ...]
    collisions: tuple[Visual, ...]
    inertial: Inertial | None
    missing: tuple[tuple[Path, ...], tuple[Path, ...]] = ((), ())

    def at_rest(self, resting: Mapping[str, float]) -> FloatArray:
        """Return the link's pose (4, 4) in its parent with its joint at the value in ``resting``.

        Values are in rad or m. A joint without a value there is at zero.
        """
        if self.joint is None or not (value := resting.get(self.joint.name, 0.0)):
            return self.T_parent_link
        return self.T_parent_link @ self.joint.motion(value)

    @cached_property
    def shapes_by_visual(self) -> tuple[Sequence[VisualMesh], ...]:
        """Surfaces of each of the link's visuals, read on first use.

        Raises RobotDescriptionError for a mesh file that cannot be read.
        """
        return tuple(map(shapes_of, self.visuals))

    @property
    def shapes(self) -> tuple[VisualMesh, ...]:
        """All surfaces of the link's visuals; see `shapes_by_visual`."""
        return tuple(itertools.chain.from_iterable(self.shapes_by_visual))

    @cached_property
    def colour(self) -> tuple[float, float, float]:
        """Colour (sRGB, 0..1) of the largest part of the link's surface; PLAIN without shapes."""
        return main_colour(self.shapes)
