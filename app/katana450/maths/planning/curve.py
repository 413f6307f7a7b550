"""What the tool is to do along a path: its point, pitch and roll as functions of one parameter.

Each curve is a formula of sigma, which runs from 0 to 1, and is asked for jets: so a place on it is
exact wherever it is asked for, and so are its derivatives. Lengths in m, angles in rad, frame {S}.
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
"""[m] A turn by 1 rad counts for as long a way, where the legs of a way are told in lengths."""

VIA_TOLERANCE = 1e-9
"""[m] Vias nearer to each other are one."""

Profile = Callable[[Jet], Jet]
"""An angle along a curve [rad], as a function of sigma."""


class ToolCoordinates(NamedTuple):
    """The five freedoms as jets: the tool point x, y, z in {S}, pitch and roll."""

    x: Jet
    y: Jet
    z: Jet
    pitch: Jet
    roll: Jet


class Curve(Protocol):
    """Where the tool is along a path."""

    @property
    def joins(self) -> tuple[float, ...]:
        """Where between 0 and 1 one formula ends and another begins, growing."""
        ...

    def at(self, sigma: Jet) -> ToolCoordinates:
        """The tool at `sigma`, one place or many."""
        ...


@dataclass(frozen=True)
class Linear:
    """An angle that goes evenly from `start` to `end` [rad]; constant where they are equal."""

    start: float
    end: float

    def __post_init__(self) -> None:
        finite_array((self.start, self.end), (2,), "The ends of an angle's profile")

    def __call__(self, sigma: Jet) -> Jet:
        return self.start + (self.end - self.start) * sigma


@dataclass(frozen=True)
class Swing:
    """An angle that follows a circle: mean + sine sin(t) + cosine cos(t) [rad].

    t runs from `begin` through `angle` [rad], as along the arc it belongs to.
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
        s, c = sin_cos(self.begin + self.angle * sigma)
        return self.mean + self.sine * s + self.cosine * c


@dataclass(frozen=True, eq=False)
class ToolLine:
    """The straight way from one target to another, pitch and roll turning evenly on it.

    With both at one point the tool only turns, which is how a cup is poured out.
    """

    start: ToolTarget
    end: ToolTarget

    def __post_init__(self) -> None:
        for name, target in (("start", self.start), ("end", self.end)):
            numbers = np.append(target.position, (target.pitch, target.roll))
            finite_array(numbers, (5,), f"The {name} of a line")

    @property
    def joins(self) -> tuple[float, ...]:
        """None: it is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        x, y, z = (
            a + (b - a) * sigma
            for a, b in zip(self.start.position.tolist(), self.end.position.tolist(), strict=True)
        )
        pitch = Linear(self.start.pitch, self.end.pitch)(sigma)
        return ToolCoordinates(x, y, z, pitch, Linear(self.start.roll, self.end.roll)(sigma))


@dataclass(frozen=True, eq=False)
class ToolLines:
    """From target to target on straight lines, pitch and roll turning evenly, its corners rounded.

    vias: two or more, the first and last are start and end. blend: (m - 2,) how much of half of its
    shorter leg each corner cuts off, above 0 up to 1. Corners are those of `Polyline`.
    """

    vias: tuple[ToolTarget, ...]
    blend: FloatArray
    _line: Polyline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = [(*via.position.tolist(), via.pitch, via.roll) for via in self.vias]
        numbers = finite_array(rows, (len(rows), 5), "The vias of lines")
        legs = np.diff(numbers, axis=0)
        ways = np.linalg.norm(legs[:, :3], axis=1)
        lengths = np.maximum(ways, TURN_LENGTH * np.abs(legs[:, 3:]).max(axis=1, initial=0.0))
        if len(rows) < 2 or (lengths <= VIA_TOLERANCE).any():
            raise InputError("Lines need two vias at least, each of them elsewhere.")
        line = Polyline(frozen(numbers), lengths, self.blend)
        object.__setattr__(self, "blend", line.blend)
        object.__setattr__(self, "_line", line)

    @property
    def joins(self) -> tuple[float, ...]:
        """Where legs and corners meet."""
        return self._line.joins

    def at(self, sigma: Jet) -> ToolCoordinates:
        return ToolCoordinates(*self._line.at(sigma))


@dataclass(frozen=True, eq=False)
class ToolArc:
    """A turn of the tool point by `angle` [rad] about an axis, a whole circle or more if it is.

    start: (3,) where it begins [m]. centre, axis: (3,) a point on the axis [m] and its direction.
    pitch, roll: what the tool does meanwhile. climb: along the axis over the whole turn [m].
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
        """None: it is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        s, c = sin_cos(self.angle * sigma)
        x, y, z = (c * u + s * v + (f + k * sigma) for u, v, f, k in self._terms)
        return ToolCoordinates(x, y, z, self.pitch(sigma), self.roll(sigma))

    @cached_property
    def _terms(self) -> list[list[float]]:
        """Of x, y, z: with the cosine, with the sine, constant, with sigma."""
        arm = self.start - self.centre
        along = (arm @ self.axis) * self.axis
        # The quarter turn of a radius is as long as it, so this is a circle to rounding.
        terms = arm - along, np.cross(self.axis, arm), self.centre + along, self.climb * self.axis
        rows: list[list[float]] = np.stack(terms, axis=1).tolist()
        return rows


@dataclass(frozen=True, eq=False)
class ToolScrew:
    """The tool moved along a twist (omega, v) in {S} from where `q` has it, as five axes can.

    The tool point follows exp(twist sigma) exactly. The tool turns to the orientation nearest to it
    that the arm's plane allows; yaw follows the arm. Source: Lynch & Park (2017), ch. 3.3; for what
    is nearest maths/kinematics/orientation.py. Raises InputError for a tool point beside the roll
    axis: the plane then depends on the turn, and the turn on the plane.
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
                "A screw path is for a tool point on the roll axis; this one is "
                f"{1e3 * arm_of(self.chain).off_axis:.3g} mm beside it. Give pitch and roll "
                "along an arc instead."
            )

    @property
    def joins(self) -> tuple[float, ...]:
        """None: it is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        arm = arm_of(self.chain)
        x, y, z, _, _ = self._way.at(sigma)
        # The orientation of {K} in {C} as a quaternion, turned by the twist.
        (w0, x0, y0, z0), (a, b, c), turn = self._turning
        s, k = sin_cos((0.5 * turn) * sigma)
        W = k * w0 - s * (a * x0 + b * y0 + c * z0)
        X = k * x0 + s * (a * w0 + b * z0 - c * y0)
        Y = k * y0 + s * (b * w0 + c * x0 - a * z0)
        Z = k * z0 + s * (c * w0 + a * y0 - b * x0)
        # Seen from the arm's plane.
        alpha1, _, _ = facing(arm, self.branch.shoulder, x, y, z)
        s, k = sin_cos(0.5 * alpha1)
        W, X, Y, Z = k * W + s * Z, k * X + s * Y, k * Y - s * X, k * Z - s * W
        total, difference = atan2(X + Y, W + Z), atan2(Y - X, W - Z)
        return ToolCoordinates(x, y, z, total + difference, total - difference)

    @cached_property
    def _way(self) -> ToolLine | ToolArc:
        """The way of the tool point."""
        p = forward(self.chain, self.q)[:3, 3]
        omega, v = self.twist[:3], self.twist[3:]
        turn = math.hypot(*omega)
        if turn == 0.0:
            return ToolLine(ToolTarget(p, 0.0, 0.0), ToolTarget(p + v, 0.0, 0.0))
        centre, climb = np.cross(omega, v) / turn**2, float(omega @ v) / turn
        return ToolArc(p, centre, omega, turn, Linear(0.0, 0.0), Linear(0.0, 0.0), climb)

    @cached_property
    def _turning(self) -> tuple[list[float], list[float], float]:
        """The quaternion of {K} in {C} at the start, the axis in {C}, the angle."""
        arm = arm_of(self.chain)
        R = arm.pose(forward(self.chain, self.q))[:3, :3]
        omega = self.twist[:3]
        turn = math.hypot(*omega)
        axis = arm.T_C_S[:3, :3] @ omega / (turn or 1.0)
        return so3.to_quaternion(R).tolist(), axis.tolist(), turn
