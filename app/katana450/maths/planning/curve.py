"""Curves of the tool: its point, pitch and roll as functions of one parameter.

Each curve is a formula of sigma, which runs from 0 to 1, and is evaluated on jets. Every place on
it is therefore exact, and so are its derivatives. Lengths in m, angles in rad, frame {S}.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet, atan2, sin_cos
from katana450.maths.planning.polyline import Polyline
from katana450.maths.planning.posture import facing

TURN_LENGTH = 0.25
"""Length [m] that stands for a turn by 1 rad, where the legs of a path are compared by length."""

VIA_TOLERANCE = 1e-9
"""Vias nearer to each other than this [m] are the same."""

Profile = Callable[[Jet], Jet]
"""An angle along a curve [rad], as a function of sigma."""


class ToolCoordinates(NamedTuple):
    """The five freedoms of the tool as jets: the tool point x, y, z in {S}, pitch and roll."""

    x: Jet
    y: Jet
    z: Jet
    pitch: Jet
    roll: Jet


class Curve(Protocol):
    """The tool along a path."""

    @property
    def joins(self) -> tuple[float, ...]:
        """The places between 0 and 1 where one formula ends and another begins, in rising order."""
        ...

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        ...


@dataclass(frozen=True)
class Linear:
    """An angle that changes evenly from `start` to `end` [rad]; constant where they are equal."""

    start: float
    end: float

    def __post_init__(self) -> None:
        finite_array((self.start, self.end), (2,), "The ends of an angle's profile")

    def __call__(self, sigma: Jet) -> Jet:
        """Return the angle [rad] at `sigma`."""
        return self.start + (self.end - self.start) * sigma


@dataclass(frozen=True)
class Swing:
    """An angle that follows a circle: mean + sine sin(t) + cosine cos(t) [rad].

    t runs from `begin` through `angle` [rad], as along the arc that the angle belongs to.
    """

    mean: float
    sine: float
    cosine: float
    begin: float
    angle: float

    def __post_init__(self) -> None:
        numbers = (self.mean, self.sine, self.cosine, self.begin, self.angle)
        finite_array(numbers, (5,), "The numbers of an angle's profile")

    def __call__(self, sigma: Jet) -> Jet:
        """Return the angle [rad] at `sigma`."""
        s, c = sin_cos(self.begin + self.angle * sigma)
        return self.mean + self.sine * s + self.cosine * c


@dataclass(frozen=True, eq=False)
class ToolLine:
    """A straight path from one target to another, on which pitch and roll turn evenly.

    With both targets at one point the tool only turns, as when a cup is emptied.
    """

    start: ToolTarget
    end: ToolTarget

    def __post_init__(self) -> None:
        for name, target in (("start", self.start), ("end", self.end)):
            numbers = np.append(target.position, (target.pitch, target.roll))
            finite_array(numbers, (5,), f"The {name} of a line")

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the line is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        x, y, z = (
            a + (b - a) * sigma
            for a, b in zip(self.start.position.tolist(), self.end.position.tolist(), strict=True)
        )
        pitch = Linear(self.start.pitch, self.end.pitch)(sigma)
        return ToolCoordinates(x, y, z, pitch, Linear(self.start.roll, self.end.roll)(sigma))


@dataclass(frozen=True, eq=False)
class ToolLines:
    """Straight lines from target to target with rounded corners; pitch and roll turn evenly.

    Corners are those of `Polyline`.

    Attributes:
        vias: two or more targets, the first and last are start and end.
        blend: fraction (m - 2,) of half of its shorter leg that each corner cuts off, above 0 up to
            1.
    """

    vias: tuple[ToolTarget, ...]
    blend: FloatArray
    _line: Polyline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = [(*via.position.tolist(), via.pitch, via.roll) for via in self.vias]
        numbers = finite_array(rows, (len(rows), 5), "The vias of lines")
        legs = np.diff(numbers, axis=0)
        distances = np.linalg.norm(legs[:, :3], axis=1)
        lengths = np.maximum(distances, TURN_LENGTH * np.abs(legs[:, 3:]).max(axis=1, initial=0.0))
        if len(rows) < 2 or (lengths <= VIA_TOLERANCE).any():
            raise InputError("Lines need at least two vias, each different from the one before.")
        line = Polyline(frozen(numbers), lengths, self.blend)
        object.__setattr__(self, "blend", line.blend)
        object.__setattr__(self, "_line", line)

    @property
    def joins(self) -> tuple[float, ...]:
        """The places where legs and corners meet."""
        return self._line.joins

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        return ToolCoordinates(*self._line.at(sigma))


@dataclass(frozen=True, eq=False)
class ToolArc:
    """A turn of the tool point by `angle` [rad] about an axis, also by more than a whole circle.

    Attributes:
        start: first point (3,) [m].
        centre, axis: a point (3,) on the axis [m] and its direction (3,).
        angle: the angle of the turn [rad].
        pitch, roll: pitch and roll of the tool along the arc.
        climb: motion along the axis over the whole turn [m].
    """

    start: FloatArray
    centre: FloatArray
    axis: FloatArray
    angle: float
    pitch: Profile
    roll: Profile
    climb: float = 0.0

    def __post_init__(self) -> None:
        for name, what in (("start", "start"), ("centre", "centre"), ("axis", "axis")):
            value = finite_array(getattr(self, name), (3,), f"The {what} of an arc")
            object.__setattr__(self, name, frozen(value))
        finite_array((self.angle, self.climb), (2,), "Angle and climb of an arc")
        length = math.hypot(*self.axis)
        if length == 0.0:
            raise InputError("The axis of an arc is zero; give it a direction.")
        object.__setattr__(self, "axis", frozen(self.axis / length))

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the arc is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        s, c = sin_cos(self.angle * sigma)
        x, y, z = (c * u + s * v + (f + k * sigma) for u, v, f, k in self._terms)
        return ToolCoordinates(x, y, z, self.pitch(sigma), self.roll(sigma))

    @cached_property
    def _terms(self) -> list[list[float]]:
        """The terms of x, y, z: with the cosine, with the sine, constant, with sigma."""
        arm = self.start - self.centre
        along = (arm @ self.axis) * self.axis
        # The quarter turn of a radius has its length, so this is a circle to rounding.
        terms = arm - along, np.cross(self.axis, arm), self.centre + along, self.climb * self.axis
        rows: list[list[float]] = np.stack(terms, axis=1).tolist()
        return rows


@dataclass(frozen=True, eq=False)
class ToolScrew:
    """A motion of the tool along a twist (omega, v) in {S} from its pose at `q`, for five axes.

    The tool point follows exp(twist sigma) exactly. The tool turns to the orientation nearest to
    that motion that the arm's plane allows; yaw follows from the arm. Sources: Lynch & Park (2017),
    ch. 3.3; for the nearest orientation maths/kinematics/orientation.py. Raises InputError for a
    tool point beside the roll axis: the plane then depends on the turn, and the turn on the plane.
    """

    chain: Chain
    branch: Branch
    q: FloatArray
    twist: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", frozen(self.chain.check_q(self.q)))
        twist = finite_array(self.twist, (6,), "The twist of a screw")
        object.__setattr__(self, "twist", frozen(twist))
        if arm_of(self.chain).off_axis > 0.0:
            raise InputError(
                "A screw path needs a tool point on the roll axis; this one is "
                f"{1e3 * arm_of(self.chain).off_axis:.3g} mm beside it. Give pitch and roll "
                "along an arc instead."
            )

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the screw is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        arm = arm_of(self.chain)
        x, y, z, _, _ = self._point_path.at(sigma)
        # The orientation of {K} in {C} as a quaternion, turned by the twist.
        (w0, x0, y0, z0), (a, b, c), turn = self._turning
        s, k = sin_cos((0.5 * turn) * sigma)
        W = k * w0 - s * (a * x0 + b * y0 + c * z0)
        X = k * x0 + s * (a * w0 + b * z0 - c * y0)
        Y = k * y0 + s * (b * w0 + c * x0 - a * z0)
        Z = k * z0 + s * (c * w0 + a * y0 - b * x0)
        # In the arm's plane.
        alpha1, _, _ = facing(arm, self.branch.shoulder, x, y, z)
        s, k = sin_cos(0.5 * alpha1)
        W, X, Y, Z = k * W + s * Z, k * X + s * Y, k * Y - s * X, k * Z - s * W
        total, difference = atan2(X + Y, W + Z), atan2(Y - X, W - Z)
        return ToolCoordinates(x, y, z, total + difference, total - difference)

    @cached_property
    def _point_path(self) -> ToolLine | ToolArc:
        """The path of the tool point."""
        p = forward(self.chain, self.q)[:3, 3]
        omega, v = self.twist[:3], self.twist[3:]
        turn = math.hypot(*omega)
        if turn == 0.0:
            return ToolLine(ToolTarget(p, 0.0, 0.0), ToolTarget(p + v, 0.0, 0.0))
        centre, climb = np.cross(omega, v) / turn**2, float(omega @ v) / turn
        return ToolArc(p, centre, omega, turn, Linear(0.0, 0.0), Linear(0.0, 0.0), climb)

    @cached_property
    def _turning(self) -> tuple[list[float], list[float], float]:
        """The quaternion of {K} in {C} at the start, the axis in {C}, and the angle."""
        arm = arm_of(self.chain)
        R = arm.pose(forward(self.chain, self.q))[:3, :3]
        omega = self.twist[:3]
        turn = math.hypot(*omega)
        axis = arm.T_C_S[:3, :3] @ omega / (turn or 1.0)
        return so3.to_quaternion(R).tolist(), axis.tolist(), turn
