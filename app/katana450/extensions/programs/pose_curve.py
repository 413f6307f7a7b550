"""Curves of poses: tool point and rotation of the tool as functions of one parameter.

They are formulas of sigma, from 0 to 1, on jets, like those of `curve`. For an arm with fewer than
six axes rotations are those with axis 1 at zero, as in `ToolPose`. Lengths in m, angles in rad,
frame {S}.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, Protocol

import numpy as np

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.general_arms.pose_equations import PoseJets
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.curve import Curve
from katana450.extensions.programs.tool_curves import rounded
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.planning.jet import Jet, sin_cos, sqrt
from katana450.maths.planning.polyline import Polyline

UNIT: Final = 1e-9
"""[1] Maximum error of the length of a unit vector."""

Terms = list[list[float]]
"""For x, y and z of a turned vector the terms with the cosine, with the sine, and without both."""


class PoseCurve(Protocol):
    """The pose of the tool along a path."""

    @property
    def joins(self) -> tuple[float, ...]:
        """The places between 0 and 1 where one formula ends and another begins, in rising order."""
        ...

    def at(self, sigma: Jet) -> PoseJets:
        """Return the pose at `sigma`, one place or many."""
        ...


@dataclass(frozen=True, eq=False)
class TurnedCurve:
    """A curve of the tool point on which the tool turns evenly about one axis.

    Attributes:
        points: the curve of the tool point; its pitch and roll are not used.
        R: rotation (3, 3) at the start.
        turn: rotation vector (3,) of the whole turn [rad], zero to keep the orientation.
    """

    points: Curve
    R: FloatArray
    turn: FloatArray

    def __post_init__(self) -> None:
        for name, shape in (("R", (3, 3)), ("turn", (3,))):
            value = finite_array(getattr(self, name), shape, "The rotation of a curve")
            object.__setattr__(self, name, frozen(value))

    @property
    def joins(self) -> tuple[float, ...]:
        """The joins of the curve of the point."""
        return self.points.joins

    def at(self, sigma: Jet) -> PoseJets:
        """Return the pose at `sigma`, one place or many."""
        x, y, z = self.points.at(sigma)[:3]
        angle, terms = self._terms
        if not angle:
            one, two, three = (tuple(map(Jet.constant, column)) for column in self.R.T.tolist())
        else:
            s, c = sin_cos(angle * sigma)
            one, two, three = (_turned(each, s, c) for each in terms)
        return PoseJets(x, y, z, (one, two, three))  # type: ignore[arg-type]

    @cached_property
    def _terms(self) -> tuple[float, list[Terms]]:
        """The angle [rad], and the terms of each column."""
        angle = math.hypot(*self.turn)
        axis = self.turn / (angle or 1.0)
        return angle, [_terms(column, axis) for column in self.R.T]


@dataclass(frozen=True, eq=False)
class PoseTurn:
    """A turn of the tool about an axis beside it, by a polynomial.

    Attributes:
        start: the pose from which the angle counts.
        point, axis: (3,) [m] and unit vector (3,) of the axis.
        angles: coefficients (n,) of the angle [rad], of the powers of 2 sigma - 1.
        axis_in_pose: the axis in the frame of the rotation of ``start``; None if it is the same.
    """

    start: ToolPose
    point: FloatArray
    axis: FloatArray
    angles: FloatArray
    axis_in_pose: FloatArray | None = None

    def __post_init__(self) -> None:
        # At least one coefficient is needed.
        sizes = {"point": 3, "axis": 3, "angles": max(np.size(self.angles), 1)}
        if self.axis_in_pose is not None:
            sizes["axis_in_pose"] = 3
        for name, size in sizes.items():
            value = finite_array(getattr(self, name), (size,), f"The {name} of a turn")
            if name.startswith("axis") and abs(math.hypot(*value) - 1.0) > UNIT:
                raise InputError(f"The {name} of a turn is not a unit vector.")
            object.__setattr__(self, name, frozen(value))

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the turn is one formula."""
        return ()

    def at(self, sigma: Jet) -> PoseJets:
        """Return the pose at `sigma`, one place or many."""
        *lower, highest = self.angles.tolist()
        s, angle = 2.0 * sigma - 1.0, highest + 0.0 * sigma
        for coefficient in reversed(lower):
            angle = angle * s + coefficient
        sine, cosine = sin_cos(angle)
        beside = self.start.position - self.point
        x, y, z = (
            place + each
            for place, each in zip(
                self.point.tolist(), _turned(_terms(beside, self.axis), sine, cosine), strict=True
            )
        )
        axis = self.axis if self.axis_in_pose is None else self.axis_in_pose
        turned = (_turned(_terms(c, axis), sine, cosine) for c in self.start.R.T)
        return PoseJets(x, y, z, tuple(turned))  # type: ignore[arg-type]


def _terms(v: FloatArray, axis: FloatArray) -> Terms:
    """Return the terms of a turn of the vector ``v`` (3,) about the unit vector ``axis`` (3,)."""
    along = (axis @ v) * axis
    terms: Terms = np.stack((v - along, np.cross(axis, v), along), axis=1).tolist()
    return terms


def _turned(terms: Terms, sine: Jet, cosine: Jet) -> tuple[Jet, ...]:
    """Return the vector of ``terms``, turned by an angle."""
    return tuple(cosine * c + sine * s + f for c, s, f in terms)


@dataclass(frozen=True, eq=False)
class PoseLines:
    """Straight lines from pose to pose with rounded corners.

    On each line the tool turns about one axis. Corners are those of `Polyline`; the rotations are
    quaternions along a polyline, divided by their length.

    Attributes:
        vias: two or more poses, the first and last are start and end.
        blend: fraction (m - 2,) of half of its shorter leg that each corner cuts off, above 0 up to
            1.
    """

    vias: tuple[ToolPose, ...]
    blend: FloatArray
    _line: Polyline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        turns = [so3.to_quaternion(via.R) for via in self.vias]
        for number, after in enumerate(turns[1:], start=1):
            # A quaternion and its opposite are the same rotation; the nearer one is taken.
            turns[number] = math.copysign(1.0, float(turns[number - 1] @ after)) * after
        rows = np.array(
            [[*via.position, *turn] for via, turn in zip(self.vias, turns, strict=True)]
        )
        numbers = finite_array(rows, (len(rows), 7), "The vias of lines")
        apart = np.array([one.apart(other) for one, other in pairwise(self.vias)]).reshape(-1, 2)
        line = rounded(numbers, apart[:, 0], apart[:, 1], self.blend)
        object.__setattr__(self, "blend", line.blend)
        object.__setattr__(self, "_line", line)

    @property
    def joins(self) -> tuple[float, ...]:
        """The places where legs and corners meet."""
        return self._line.joins

    def at(self, sigma: Jet) -> PoseJets:
        """Return the pose at `sigma`, one place or many."""
        x, y, z, *turn = self._line.at(sigma)
        length = sqrt(sum((each * each for each in turn), start=Jet.constant(0.0)))
        w, a, b, c = (each / length for each in turn)
        one = (1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b + w * c), 2.0 * (a * c - w * b))
        two = (2.0 * (a * b - w * c), 1.0 - 2.0 * (a * a + c * c), 2.0 * (b * c + w * a))
        three = (2.0 * (a * c + w * b), 2.0 * (b * c - w * a), 1.0 - 2.0 * (a * a + b * b))
        return PoseJets(x, y, z, (one, two, three))
