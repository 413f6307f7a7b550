"""Curves of the tool that only scripts use; see ``extensions/programs/curve.py``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.programs.curve import Linear, ToolArc, ToolCoordinates, ToolLine
from katana450.extensions.programs.jet_posture import facing
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet, atan2, sin_cos
from katana450.maths.planning.polyline import Polyline

TURN_LENGTH = 0.25
"""Length [m] that stands for a turn by 1 rad, where the legs of a path are compared by length."""

VIA_TOLERANCE = 1e-9
"""Vias nearer to each other than this [m] are the same."""


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


def rounded(
    vias: FloatArray, distances: FloatArray, angles: FloatArray, blend: FloatArray
) -> Polyline:
    """Return the legs through the vias of a tool, with rounded corners.

    Args:
        vias: (m, k) coordinates of the tool, two or more rows.
        distances: (m - 1,) how far each leg moves the tool point [m].
        angles: (m - 1,) how far each leg turns the tool [rad].
        blend: (m - 2,) see `Polyline`.

    Raises InputError for fewer than two vias, and for a leg that neither moves nor turns the tool.
    """
    lengths = np.maximum(distances, TURN_LENGTH * angles)
    if len(vias) < 2 or (lengths <= VIA_TOLERANCE).any():
        raise InputError("Lines need at least two vias, each different from the one before.")
    return Polyline(frozen(vias), lengths, blend)


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
        angles = np.abs(legs[:, 3:]).max(axis=1, initial=0.0)
        line = rounded(numbers, np.linalg.norm(legs[:, :3], axis=1), angles, self.blend)
        object.__setattr__(self, "blend", line.blend)
        object.__setattr__(self, "_line", line)

    @property
    def joins(self) -> tuple[float, ...]:
        """The places where legs and corners meet."""
        return self._line.joins

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        return ToolCoordinates(*self._line.at(sigma))


def screw_points(p: FloatArray, twist: FloatArray) -> ToolLine | ToolArc:
    """Return the path of the point ``p`` (3,) [m] along ``twist`` (6,), with pitch and roll 0."""
    omega, v = twist[:3], twist[3:]
    turn = math.hypot(*omega)
    if turn == 0.0:
        return ToolLine(ToolTarget(p, 0.0, 0.0), ToolTarget(p + v, 0.0, 0.0))
    centre, climb = np.cross(omega, v) / turn**2, float(omega @ v) / turn
    return ToolArc(p, centre, omega, turn, Linear(0.0, 0.0), Linear(0.0, 0.0), climb)


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
        return screw_points(forward(self.chain, self.q)[:3, 3], self.twist)

    @cached_property
    def _turning(self) -> tuple[list[float], list[float], float]:
        """The quaternion of {K} in {C} at the start, the axis in {C}, and the angle."""
        arm = arm_of(self.chain)
        R = arm.pose(forward(self.chain, self.q))[:3, :3]
        omega = self.twist[:3]
        turn = math.hypot(*omega)
        axis = arm.T_C_S[:3, :3] @ omega / (turn or 1.0)
        return so3.to_quaternion(R).tolist(), axis.tolist(), turn


@dataclass(frozen=True, eq=False)
class ToolTurn:
    """A turn of the tool about its own axis by a polynomial, with one pitch.

    Attributes:
        target: point and pitch; its roll is not used.
        rolls: coefficients (n,) of the roll [rad], of the powers of 2 sigma - 1.
        offsets: coefficients (m, 3) of the way of the tool point from ``target`` [m]; None if it
            stays there.
    """

    target: ToolTarget
    rolls: FloatArray
    offsets: FloatArray | None = None

    def __post_init__(self) -> None:
        rolls = finite_array(self.rolls, (np.size(self.rolls),), "The coefficients of a roll")
        object.__setattr__(self, "rolls", frozen(rolls))
        if self.offsets is not None:
            shape = (max(len(self.offsets), 1), 3)
            offsets = finite_array(self.offsets, shape, "The coefficients of a way")
            object.__setattr__(self, "offsets", frozen(offsets))

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the turn is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        position = self.target.position.tolist()
        if self.offsets is None:
            x, y, z = (place + 0.0 * sigma for place in position)
        else:
            ways = zip(position, self.offsets.T.tolist(), strict=True)
            x, y, z = (place + _polynomial(each, sigma) for place, each in ways)
        roll = _polynomial(self.rolls.tolist(), sigma)
        return ToolCoordinates(x, y, z, self.target.pitch + 0.0 * sigma, roll)


def _polynomial(coefficients: Sequence[float], sigma: Jet) -> Jet:
    """Return the polynomial of 2 sigma - 1."""
    *lower, highest = coefficients
    s, value = 2.0 * sigma - 1.0, highest + 0.0 * sigma
    for coefficient in reversed(lower):
        value = value * s + coefficient
    return value
