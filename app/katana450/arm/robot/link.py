"""A link of a robot and the joint that connects it to its parent."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.robot.surfaces import VisualMesh, shapes_of
from katana450.arm.robot.visual import Visual
from katana450.caching import cached_property
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

SLOW_TURN, SLOW_SLIDE = 1.0, 0.1
"""[rad/s, m/s] Speed of a joint if its file states none."""


class JointLimit(NamedTuple):
    """Limits [rad, m], maximum speed [rad/s, m/s] and force [N m, N] of a joint, where stated."""

    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None


class Mimic(NamedTuple):
    """The joint that another follows: value = multiplier * (value of ``joint``) + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """The connection of a link to its parent.

    Attributes:
        name: of the joint.
        type: one of ``description.JOINTS``.
        parent, child: names of its links.
        T_parent_child: (4, 4) pose of the child in the parent at zero [m].
        axis: (3,) direction in the frame of the child, of unit length unless the file has none.
        limit: limits, speed and force, if stated.
        mimic: the joint that it follows directly, if any.
        damping, friction: [N m s/rad, N s/m] and [N m, N], 0 if the file states none.
        leader: the driven joint whose value it follows; its own name if it is driven itself.
        factor, offset: value = factor * leader + offset.
    """

    name: str
    type: str
    parent: str
    child: str
    T_parent_child: FloatArray
    axis: FloatArray
    limit: JointLimit | None
    mimic: Mimic | None
    damping: float
    friction: float
    leader: str = ""
    factor: float = 1.0
    offset: float = 0.0

    @property
    def slides(self) -> bool:
        """True if it is prismatic; else it turns."""
        return self.type == "prismatic"

    @property
    def lower(self) -> float:
        """Lower limit [rad] or [m], infinite if there is none."""
        lower = None if self.limit is None or self.type == "continuous" else self.limit.lower
        return -math.inf if lower is None else lower

    @property
    def upper(self) -> float:
        """Upper limit [rad] or [m], infinite if there is none."""
        upper = None if self.limit is None or self.type == "continuous" else self.limit.upper
        return math.inf if upper is None else upper

    @property
    def has_speed(self) -> bool:
        """True if the file states a maximum speed."""
        return self.limit is not None and 0.0 < (self.limit.velocity or 0.0) < math.inf

    @property
    def speed(self) -> float:
        """Maximum speed [rad/s] or [m/s], a slow one if the file states none."""
        if self.limit is not None and self.has_speed:
            return float(self.limit.velocity or 0.0)
        return SLOW_SLIDE if self.slides else SLOW_TURN

    @property
    def effort(self) -> float:
        """Maximum force [N m] or [N], 0 if the file states none."""
        return 0.0 if self.limit is None else self.limit.effort or 0.0

    def motion(self, value: float) -> FloatArray:
        """Return the pose (4, 4) that the joint adds at ``value`` [rad] or [m]."""
        if self.slides:
            return se3.from_rotation_translation(np.eye(3), value * self.axis)
        return se3.from_rotation_translation(so3.exp(value * self.axis), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Inertial:
    """The mass of a link.

    Attributes:
        mass: [kg], above 0.
        T_link_inertia: (4, 4) pose of the frame of ``moments``, its origin the centre of mass [m].
        moments: (3, 3) inertia [kg m^2].
    """

    mass: float
    T_link_inertia: FloatArray
    moments: FloatArray

    @property
    def principal(self) -> tuple[FloatArray, FloatArray]:
        """The principal moments (3,) [kg m^2], and their right-handed axes (3, 3) in the link."""
        values, axes = np.linalg.eigh(self.moments)
        axes = axes * np.sign(np.linalg.det(axes))
        return values, self.T_link_inertia[:3, :3] @ axes


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
