"""Curves of the tool as functions of one parameter.

Each curve is a formula of sigma, which runs from 0 to 1, and is evaluated on jets. Every place on
it is therefore exact, and so are its derivatives. The five-axis family has curves of the tool
point, pitch and roll. Other arms have curves of poses: of fewer than six axes their rotations are
those with axis 1 at zero, as in `ToolTarget`. Lengths in m, angles in rad, frame {S}.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from typing import ClassVar, Final, Protocol

import numpy as np

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet, sin_cos, sqrt
from katana450.maths.planning.polyline import Polyline, polynomial
from katana450.maths.planning.posture import ThreeJets, ToolJets, posture

TURN_LENGTH = 0.25
"""Length [m] that stands for a turn by 1 rad, where the legs of a path are compared by length."""

VIA_TOLERANCE = 1e-9
"""Vias nearer to each other than this [m] are the same."""

UNIT: Final = 1e-9
"""[1] Maximum error of the length of a unit vector."""

Profile = Callable[[Jet], Jet]
"""An angle along a curve [rad], as a function of sigma."""

Terms = list[list[float]]
"""For x, y and z of a turned vector the terms with the cosine, with the sine, and without both."""


class Curve(Protocol):
    """The tool along a path."""

    @property
    def joins(self) -> tuple[float, ...]:
        """The places between 0 and 1 where one formula ends and another begins, in rising order."""
        ...

    def at(self, sigma: Jet) -> ToolJets:
        """Return the tool at `sigma`, one place or many."""
        ...


class _OneFormula:
    """A curve of one formula, which has no joins."""

    joins: ClassVar[tuple[float, ...]] = ()


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


@dataclass(frozen=True, eq=False)
class ToolLine(_OneFormula):
    """A straight path from one target to another, on which pitch and roll turn evenly.

    With both targets at one point the tool only turns, as when a cup is emptied.
    """

    start: ToolTarget
    end: ToolTarget

    def __post_init__(self) -> None:
        for name, target in (("start", self.start), ("end", self.end)):
            numbers = np.append(target.position, (target.pitch, target.roll))
            finite_array(numbers, (5,), f"The {name} of a line")

    def at(self, sigma: Jet) -> ToolJets:
        """Return the tool at `sigma`, one place or many."""
        x, y, z = (
            a + (b - a) * sigma
            for a, b in zip(self.start.position.tolist(), self.end.position.tolist(), strict=True)
        )
        pitch = Linear(self.start.pitch, self.end.pitch)(sigma)
        return ToolJets(x, y, z, pitch, Linear(self.start.roll, self.end.roll)(sigma))


@dataclass(frozen=True, eq=False)
class ToolArc(_OneFormula):
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

    def at(self, sigma: Jet) -> ToolJets:
        """Return the tool at `sigma`, one place or many."""
        s, c = sin_cos(self.angle * sigma)
        x, y, z = (c * u + s * v + (f + k * sigma) for u, v, f, k in self._terms)
        return ToolJets(x, y, z, self.pitch(sigma), self.roll(sigma))

    @cached_property
    def _terms(self) -> list[list[float]]:
        """The terms of x, y, z: with the cosine, with the sine, constant, with sigma."""
        arm = self.start - self.centre
        along = (arm @ self.axis) * self.axis
        # The quarter turn of a radius has its length, so this is a circle to rounding.
        terms = arm - along, np.cross(self.axis, arm), self.centre + along, self.climb * self.axis
        rows: list[list[float]] = np.stack(terms, axis=1).tolist()
        return rows


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
class ToolLines:
    """Straight lines from target to target with rounded corners, on which the tool turns evenly.

    Corners are those of `Polyline`. Rotations are quaternions along it, divided by their length.

    Attributes:
        vias: two or more targets of one arm, the first and last are start and end.
        blend: fraction (m - 2,) of half of its shorter leg that each corner cuts off, above 0 up to
            1.

    Raises InputError for fewer than two vias, and for a leg that neither moves nor turns the tool.
    """

    vias: tuple[ToolTarget, ...]
    blend: FloatArray
    _line: Polyline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = self._rows()
        numbers = finite_array(rows, (len(rows), len(rows[0]) if rows else 5), "The vias of lines")
        legs = np.array([one.apart(other) for one, other in pairwise(self.vias)]).reshape(-1, 2)
        lengths = np.maximum(legs[:, 0], TURN_LENGTH * legs[:, 1])
        if len(rows) < 2 or (lengths <= VIA_TOLERANCE).any():
            raise InputError("Lines need at least two vias, each different from the one before.")
        line = Polyline(frozen(numbers), lengths, self.blend)
        object.__setattr__(self, "blend", line.blend)
        object.__setattr__(self, "_line", line)

    def _rows(self) -> list[list[float]]:
        """Return the coordinates of the vias: the point, then pitch and roll, or a quaternion."""
        rows: list[list[float]] = []
        for via in self.vias:
            if via.is_pitched != self.vias[0].is_pitched:
                raise InputError("The vias of lines must be targets of one arm.")
            if via.is_pitched:
                turn = [via.pitch, via.roll]
            else:
                quaternion = so3.to_quaternion(via.R)
                # A quaternion and its opposite are the same rotation; the nearer one is taken.
                before = rows[-1][3:] if rows else quaternion
                turn = (math.copysign(1.0, float(quaternion @ before)) * quaternion).tolist()
            rows.append([*via.position.tolist(), *turn])
        return rows

    @property
    def joins(self) -> tuple[float, ...]:
        """The places where legs and corners meet."""
        return self._line.joins

    def at(self, sigma: Jet) -> ToolJets:
        """Return the tool at `sigma`, one place or many."""
        x, y, z, *turn = self._line.at(sigma)
        if self.vias[0].is_pitched:
            pitch, roll = turn
            return ToolJets(x, y, z, pitch, roll)
        length = sqrt(sum((number * number for number in turn), start=Jet.constant(0.0)))
        w, a, b, c = (number / length for number in turn)
        one = (1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b + w * c), 2.0 * (a * c - w * b))
        two = (2.0 * (a * b - w * c), 1.0 - 2.0 * (a * a + c * c), 2.0 * (b * c + w * a))
        three = (2.0 * (a * c + w * b), 2.0 * (b * c - w * a), 1.0 - 2.0 * (a * a + b * b))
        return ToolJets.turned((x, y, z), (one, two, three))


@dataclass(frozen=True, eq=False)
class ToolTurn(_OneFormula):
    """A turn of the tool about its own axis by a polynomial, with one pitch.

    Attributes:
        target: point and pitch; its roll is not used.
        rolls: coefficients (n,) of the roll [rad], of the powers of 2 sigma - 1.
        offsets: coefficients (m, 3) of the path of the tool point from ``target`` [m]; None if it
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
            offsets = finite_array(self.offsets, shape, "The coefficients of a path")
            object.__setattr__(self, "offsets", frozen(offsets))

    def at(self, sigma: Jet) -> ToolJets:
        """Return the tool at `sigma`, one place or many."""
        s, zero = 2.0 * sigma - 1.0, 0.0 * sigma
        x, y, z = (place + zero for place in self.target.position.tolist())
        if self.offsets is not None:
            ways = zip((x, y, z), self.offsets.T.tolist(), strict=True)
            x, y, z = (place + polynomial(coefficients, s) for place, coefficients in ways)
        roll = zero + polynomial(self.rolls.tolist(), s)
        return ToolJets(x, y, z, self.target.pitch + 0.0 * sigma, roll)


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

    def at(self, sigma: Jet) -> ToolJets:
        """Return the pose at `sigma`, one place or many."""
        x, y, z = self.points.at(sigma)[:3]
        angle, terms = self._terms
        if not angle:
            one, two, three = (
                (Jet.constant(a), Jet.constant(b), Jet.constant(c)) for a, b, c in self.R.T.tolist()
            )
        else:
            s, c = sin_cos(angle * sigma)
            one, two, three = (_turned(column, s, c) for column in terms)
        return ToolJets.turned((x, y, z), (one, two, three))

    @cached_property
    def _terms(self) -> tuple[float, list[Terms]]:
        """The angle [rad], and the terms of each column."""
        angle = math.hypot(*self.turn)
        axis = self.turn / (angle or 1.0)
        return angle, [_terms(column, axis) for column in self.R.T]


@dataclass(frozen=True, eq=False)
class PoseTurn(_OneFormula):
    """A turn of the tool about an axis beside it, by a polynomial.

    Attributes:
        start: the pose from which the angle counts.
        point, axis: (3,) [m] and unit vector (3,) of the axis.
        angles: coefficients (n,) of the angle [rad], of the powers of 2 sigma - 1.
        axis_in_pose: the axis in the frame of the rotation of ``start``; None if it is the same.
    """

    start: ToolTarget
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

    def at(self, sigma: Jet) -> ToolJets:
        """Return the pose at `sigma`, one place or many."""
        sine, cosine = sin_cos(polynomial(self.angles.tolist(), 2.0 * sigma - 1.0))
        arm = self.start.position - self.point
        x, y, z = (
            place + offset
            for place, offset in zip(
                self.point.tolist(), _turned(_terms(arm, self.axis), sine, cosine), strict=True
            )
        )
        axis = self.axis if self.axis_in_pose is None else self.axis_in_pose
        one, two, three = (_turned(_terms(column, axis), sine, cosine) for column in self.start.R.T)
        return ToolJets.turned((x, y, z), (one, two, three))


def line_between(start: ToolTarget, end: ToolTarget) -> Curve:
    """Return the straight line on which the tool turns evenly from ``start`` to ``end``."""
    if start.is_pitched:
        return ToolLine(start, end)
    return _evenly_turned(
        ToolLine(ToolTarget(start.position), ToolTarget(end.position)), start, end
    )


def arc_between(
    centre: FloatArray,
    axis: FloatArray,
    angle: float,
    climb: float,
    start: ToolTarget,
    end: ToolTarget,
) -> Curve:
    """Return the turn of the tool point from ``start`` about ``axis`` through ``centre``.

    ``angle`` [rad], ``climb`` along the axis [m]. The tool turns evenly to the orientation of
    ``end``.
    """
    pitch, roll = Linear(start.pitch, end.pitch), Linear(start.roll, end.roll)
    arc = ToolArc(start.position, centre, axis, angle, pitch, roll, climb)
    return arc if start.is_pitched else _evenly_turned(arc, start, end)


def _evenly_turned(points: Curve, start: ToolTarget, end: ToolTarget) -> TurnedCurve:
    """Return the curve along ``points`` on which the tool turns about one axis."""
    return TurnedCurve(points, start.R, so3.log(end.R @ start.R.T))


def _terms(v: FloatArray, axis: FloatArray) -> Terms:
    """Return the terms of a turn of the vector ``v`` (3,) about the unit vector ``axis`` (3,)."""
    along = (axis @ v) * axis
    terms: Terms = np.stack((v - along, np.cross(axis, v), along), axis=1).tolist()
    return terms


def _turned(terms: Terms, sine: Jet, cosine: Jet) -> ThreeJets:
    """Return the vector of ``terms``, turned by an angle."""
    x, y, z = (cosine * c + sine * s + f for c, s, f in terms)
    return x, y, z


ARC_SAMPLES: Final = 48
"""Number of intervals of the arc that are checked."""

SWINGS: Final = np.radians((-30.0, -15.0, 0.0, 15.0, 30.0))
"""First values for the amplitude of the pitch along the arc [rad]."""

MEANS: Final = 72
"""Number of mean pitches that are tried, all round."""

HALVINGS: Final = 12
"""Number of halvings of the steps that refine the best; the last is a thousandth of a degree."""


def roomiest(chain: Chain, branch: AnyBranch, arc: Curve) -> ToolArc:
    """Return `arc` with the swing of its pitch that keeps axes 1 to 4 farthest from their limits.

    The pitch is a mean plus a wave of the arc's own angle, found on a grid and then by ever smaller
    steps. Raises InputError when no such pitch keeps the joints inside on `branch`, and for an arm
    whose orientations are no pitches.
    """
    if not isinstance(arc, ToolArc):
        raise InputError(
            "`roomiest` chooses the pitch of a five-axis arm, and this one has "
            f"{chain.n} axes. Give the orientation, or leave it out to keep it."
        )
    grid = np.array(
        list(product(np.linspace(-math.pi, math.pi, MEANS, endpoint=False), SWINGS, SWINGS))
    )
    five = Branch.parse(str(branch))
    rooms = _rooms(chain, five, arc, grid)
    best, room = grid[rooms.argmax()], float(rooms.max())
    if not room > 0.0:
        raise InputError(
            f"No pitch keeps the joints inside their limits along this arc on the branch {branch}. "
            "Move the arc, make it smaller, or take another branch."
        )
    step = np.array((math.tau / MEANS, SWINGS[1] - SWINGS[0], SWINGS[1] - SWINGS[0]))
    around = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    for _ in range(HALVINGS):
        step *= 0.5
        for _ in range(4):
            candidates = best + around * step
            rooms = _rooms(chain, five, arc, candidates)
            if rooms.max() <= room:
                break
            best, room = candidates[rooms.argmax()], float(rooms.max())
    mean, sine, cosine = best.tolist()
    return replace(arc, pitch=Swing(mean, sine, cosine, 0.0, arc.angle))


def _rooms(chain: Chain, branch: Branch, arc: ToolArc, swings: FloatArray) -> FloatArray:
    """Return the minimum distance (G,) [rad] of axes 1 to 4 from their limits on the arc.

    `swings` (G, 3) are the tried pitches. The value is below 0 beyond the limits, and -infinity out
    of reach.
    """
    arm = arm_of(chain)
    sigma = np.linspace(0.0, 1.0, ARC_SAMPLES + 1)
    tool = arc.at(Jet.constant(sigma))
    t = arc.angle * sigma
    pitch = swings @ np.stack((np.ones_like(t), np.sin(t), np.cos(t)))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        alpha = posture(arm, branch, *tool[:3], Jet.constant(pitch), tool.roll)
    room = np.full(len(swings), np.inf)
    for axis in range(4):
        q = (alpha[axis].c0 - arm.shifts[axis]) * arm.signs[axis]
        lower, upper = chain.lower[axis], chain.upper[axis]
        middle = 0.5 * (lower + upper)
        off = np.abs(np.remainder(q - middle + math.pi, math.tau) - math.pi)
        minimum = np.min(0.5 * (upper - lower) - off, axis=-1)
        room = np.minimum(room, np.where(np.isnan(minimum), -np.inf, minimum))
    return room
