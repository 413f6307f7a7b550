"""Joint paths that keep the tool on a curve, of the five-axis family and of every other arm.

`ToolPath` is the closed form at every place, without interpolation.

`PosePath` is followed from a posture: places on the curve, one after another. Each is found by
Newton's method from the one before, and the step is halved until it surely stays on the branch: by
Weyl's inequality no singular posture lies between two postures whose deciding matrices differ by
less than the smallest singular value of one. A step is half of that at most. So a path ends before
a singularity, as a drag does, and never leaps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from katana450 import tolerances
from katana450.arm.control.state.messages import axis_names, joint_unit
from katana450.errors import InputError, PathError
from katana450.extensions.general_arms.descent import WALL
from katana450.extensions.general_arms.pose_equations import PoseEquations, RegularPosture
from katana450.extensions.programs.planning.curves import Curve
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.nearest_posture import nearest_posture
from katana450.maths.kinematics.planar import LimitedArm
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import pitch_and_roll
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.jet import Coefficient, Jet
from katana450.maths.planning.path import CurvePath, joint_derivatives
from katana450.maths.planning.polyline import PiecewisePolynomial
from katana450.maths.planning.posture import FiveJets, JointJets, posture

KNOTS = 400
"""Number of intervals in which a path is checked when it is built."""

MIN_KNOTS = 16
"""Minimum number of intervals on each piece of its curve."""

MIN_KNOT_GAP = 1e-9
"""Minimum distance [1] of two checked places."""

KINK_TOLERANCE = 1e-4
"""Maximum deviation [rad] of an axis from the cubic through two neighbouring places; more means
that the path meets the end of the branch between them.
"""

HALVINGS = 40
"""Number of halvings that find the place where a path fails to rounding."""


@dataclass(frozen=True, eq=False)
class ToolPath(CurvePath):
    """The joints on `branch` that keep the tool on `curve`.

    Raises InputError where the curve leaves the branch's reach or the limits, or meets the end of
    the branch. The message states the place on the path, the constraint and the remedy.

    Attributes:
        chain: the arm with its tool.
        curve: the path of the tool.
        branch: the branch of the joints.
        near: joint angles (5,) [rad]; each angle starts in the turn nearest to this, or in another
            one if only that is inside the limits.
    """

    chain: Chain
    curve: Curve
    branch: Branch
    near: FloatArray
    _turns: FloatArray = field(init=False, repr=False)
    _sigma: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        near = frozen(self.chain.check_q(self.near))
        object.__setattr__(self, "near", near)
        sigma = frozen(self._places())
        q, qd = self._unwound(sigma)
        bad = np.flatnonzero(~np.isfinite(qd).all(axis=1))
        if bad.size:
            self._refuse_reach(sigma, int(bad[0]))
        q[0] = self._in_turn(q[0])
        q = np.unwrap(q, axis=0)
        object.__setattr__(self, "_sigma", sigma)
        even = np.searchsorted(sigma, np.linspace(0.0, 1.0, KNOTS + 1) - 0.5 * MIN_KNOT_GAP)
        object.__setattr__(self, "_turns", frozen(q[even]))
        self._refuse_kinks(q, qd)
        self._refuse_limits(q, qd)

    def joints(self, sigma: Jet) -> FiveJets:
        """Return the joint angles [rad] at `sigma`, one place or many (N,)."""
        arm = arm_of(self.chain)
        alpha = posture(arm, self.branch, *self.curve.at(sigma)[:5])
        joints = []
        for axis, (angle, sign, shift) in enumerate(zip(alpha, arm.signs, arm.shifts, strict=True)):
            q = sign * (angle - shift) if sign != 1.0 or shift else angle
            turns = self._turn(axis, sigma.c0, q.c0)
            joints.append(q + turns * math.tau if np.any(turns) else q)
        one, two, three, four, five = joints
        return one, two, three, four, five

    def turned_off(self, sigma: FloatArray, q: FloatArray) -> FloatArray:
        """Return the largest errors (N,) [rad] of pitch and roll at `q` (N, n)."""
        tool = self.curve.at(Jet.variable(sigma))
        wanted = np.stack([np.broadcast_to(jet.c0, sigma.shape) for jet in tool[3:5]], axis=1)
        reached = np.array([pitch_and_roll(self.chain, posture) for posture in q])
        off = reached - wanted
        errors: FloatArray = np.abs(off - math.tau * np.rint(off / math.tau)).max(axis=1)
        return errors

    def _in_turn(self, q: FloatArray) -> FloatArray:
        """Return the angles `q` (5,) [rad], known up to whole turns, as the path starts at them."""
        lower, upper, slack = self.chain.lower, self.chain.upper, tolerances.LIMIT_SLACK
        near, inside = (
            q + np.rint((posture - q) / math.tau) * math.tau
            for posture in (self.near, 0.5 * (lower + upper))
        )
        return np.where((near < lower - slack) | (near > upper + slack), inside, near)

    def _turn(self, axis: int, sigma: Coefficient, angle: Coefficient) -> Coefficient:
        """Return the number of turns to add to `angle`, which continue along the path."""
        knots = self._turns[:, axis]
        if isinstance(sigma, float):
            place = min(max(round(sigma * KNOTS), 0), KNOTS)
            return round((float(knots[place]) - angle) / math.tau)
        place = np.clip(np.rint(sigma * KNOTS), 0, KNOTS).astype(np.int64)
        return np.rint((knots[place] - angle) / math.tau)

    def _places(self) -> FloatArray:
        """Return the places to check: evenly spaced, and enough on each piece of the curve."""
        even = np.linspace(0.0, 1.0, KNOTS + 1)
        ends = (0.0, *self.joins, 1.0)
        if len(ends) == 2:
            return even
        pieces = [np.linspace(low, high, MIN_KNOTS + 1) for low, high in pairwise(ends)]
        inner = np.unique(np.concatenate(pieces))
        near = even[np.clip(np.rint(inner * KNOTS), 0, KNOTS).astype(np.int64)]
        return np.unique(np.concatenate((even, inner[np.abs(inner - near) > MIN_KNOT_GAP])))

    def _unwound(self, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return angles and rates (N, 5) in any turn; values out of reach are not finite."""
        arm = arm_of(self.chain)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            alpha = posture(arm, self.branch, *self.curve.at(Jet.variable(sigma))[:5])
            q = np.stack([np.broadcast_to(jet.c0, sigma.shape) for jet in alpha], axis=1)
            qd = np.stack([np.broadcast_to(jet.c1, sigma.shape) for jet in alpha], axis=1)
        return (q - arm.shifts) * arm.signs, qd * arm.signs

    def _refuse_reach(self, sigma: FloatArray, bad: int) -> None:
        """Raise InputError for a path that leaves the reach at or before the place `bad`."""
        good, failing = float(sigma[max(bad - 1, 0)]), float(sigma[bad])
        for _ in range(HALVINGS if bad else 0):
            middle = 0.5 * (good + failing)
            _, qd = self._unwound(np.array([middle]))
            good, failing = (middle, failing) if np.isfinite(qd).all() else (good, middle)
        target = self.curve.at(Jet.variable(failing)).target
        limited = LimitedArm.of(self.chain, within_limits=False)
        canonical = target.canonical(limited.arm, Priority.PITCH)
        best = nearest_posture(limited, canonical, self.branch, limited.arm.angles(self.near))
        short = f", {1e3 * best.position_error:.1f} mm beyond reach" if not bad else ""
        raise PathError(
            f"The path leaves the reach of the arm on the branch {self.branch} "
            f"{at_place(failing)} with a pitch of {math.degrees(target.pitch):.1f} deg{short}. "
            "Links come in line there, or the tool comes over axis 1. Keep the path nearer to the "
            "arm, or give it another pitch.",
            target.position.tolist(),
        )

    def _refuse_kinks(self, q: FloatArray, qd: FloatArray) -> None:
        """Raise InputError where angles leap or turn back at the end of a branch.

        This also finds ends between two checked places.
        """
        h = np.diff(self._sigma)[:, None]
        middle, _ = self._unwound(self._sigma[:-1] + 0.5 * h[:, 0])
        smooth = 0.5 * (q[:-1] + q[1:]) + 0.125 * h * (qd[:-1] - qd[1:])
        gap = np.abs(np.remainder(middle - smooth + math.pi, math.tau) - math.pi)
        kinked = ~(gap <= KINK_TOLERANCE)
        if kinked.any():
            place, axis = (int(index) for index in np.argwhere(kinked)[0])
            sigma = float(self._sigma[place])
            raise PathError(
                f"Axis {axis + 1} would have to leap or turn back at once {at_place(sigma)}. "
                "Links come in line there, or the tool passes over axis 1. Lead the path around "
                "that place.",
                self.curve.at(Jet.variable(sigma)).target.position.tolist(),
            )

    def _refuse_limits(self, q: FloatArray, qd: FloatArray) -> None:
        """Raise InputError where an axis exceeds its limit.

        Extremes between two places are those of the cubic through their angles and rates.
        """
        refusal = limit_refusal(self.chain, self._sigma, q, qd)
        if refusal is not None:
            sigma, why = refusal
            point = self.curve.at(Jet.variable(sigma)).target.position.tolist()
            raise PathError(f"{why} Shift the path, or give it another pitch or roll.", point)


def at_place(sigma: float) -> str:
    """Return the place in words for a PathError, which names the point."""
    return f"{100.0 * sigma:.1f} % along it, at {{point}}"


def limit_refusal(
    chain: Chain, sigma: FloatArray, q: FloatArray, qd: FloatArray
) -> tuple[float, str] | None:
    """Return the place where an axis first exceeds its limit, and a sentence; None without one.

    Extremes between two places are those of the cubic through their angles and rates.

    Args:
        chain: the arm with its tool.
        sigma: (N,) rising places.
        q: (N, n) angles there [rad].
        qd: (N, n) rates there [rad].
    """
    slack, lower, upper = tolerances.LIMIT_SLACK, chain.lower, chain.upper
    beyond = np.maximum(lower - q, q - upper)
    extreme = _peaks(q, qd, np.diff(sigma)[:, None])
    over = np.maximum(beyond[:-1], np.maximum(lower - extreme, extreme - upper))
    over[-1] = np.maximum(over[-1], beyond[-1])
    if over.max() <= slack:
        return None
    place = int(np.flatnonzero((over > slack).any(axis=1))[0])
    axis = int(over[place].argmax())
    worst = float(np.maximum(beyond, 0.0)[:, axis].max(initial=float(over[:, axis].max())))
    limit = lower[axis] if q[place, axis] < 0.5 * (lower + upper)[axis] else upper[axis]
    first = float(sigma[place])
    if place > 0 and beyond[place, axis] > slack:
        passed = beyond[place, axis] / (beyond[place] - beyond[place - 1])[axis]
        first -= float(passed) * (first - float(sigma[place - 1]))
    factor, unit = joint_unit(slides=chain.slides[axis])
    return first, (
        f"The path takes axis {axis + 1}, {axis_names(chain.names)[axis]}, over its limit of "
        f"{factor * limit:.1f} {unit} {at_place(first)}, by up to {factor * worst:.3g} {unit} "
        "later on."
    )


def _peaks(q: FloatArray, qd: FloatArray, h: FloatArray) -> FloatArray:
    """Return the extreme (N, n) inside each piece of length `h` (N, 1), or its start if none."""
    a, b = q[:-1], q[1:]
    da, db = h * qd[:-1], h * qd[1:]
    turns = da * db < 0.0
    # The Hermite cubic, a + da t + e t^2 + f t^3, where its rate is 0 between the ends.
    e, f = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
    root = np.sqrt(np.maximum(e * e - 3.0 * f * da, 0.0))
    divisor = -e - np.copysign(root, e)
    peaks = a
    with np.errstate(divide="ignore", invalid="ignore"):
        for t in (da / divisor, divisor / (3.0 * f)):
            inside = turns & (t > 0.0) & (t < 1.0)
            t_in = np.where(inside, t, 0.0)
            peaks = np.where(inside, a + t_in * (da + t_in * (e + t_in * f)), peaks)
    return peaks


FIRST_STEP: Final = 1.0 / 32.0
"""[1] Largest step from place to place."""

LEAST_STEP: Final = 2.0**-16
"""[1] Smallest step; a curve that needs a smaller one comes to an edge of the branch."""

LARGEST_TURN: Final = 0.2
"""[rad] Maximum turn of a joint in one step."""

BESIDE: Final = 1e-10
"""[rad] Largest deviation of the polynomials from the exact joints, half-way between two places."""

ROUNDS: Final = 8
"""Maximum number of rounds that divide pieces whose polynomials deviate by more."""

PARTS: Final = 8
"""Number of parts of each piece in which the limits are checked."""

TIMED_PIECES, TIMED_PARTS, PIECES_OF_JOIN = 12, 4, 6
"""The number of pieces with which the timing begins, how many times it must look at the shortest
piece, and the number of pieces that a join adds to it; see maths/planning/pacing.py."""

LOOKS_PER_PIECE: Final = 16
"""Number of places at which the timing looks in one of its pieces."""

TAKES_PART: Final = 0.3
"""[1] Component of a unit motion of the joints from which on a joint is named."""

MOSTLY: Final = 0.7
"""[1] Part of a lost motion that is a translation, from which on it counts as one."""

SEPTIC: Final = np.array(
    [
        [35.0, -15.0, 2.5, -1.0 / 6.0],
        [-84.0, 39.0, -7.0, 0.5],
        [70.0, -34.0, 6.5, -0.5],
        [-20.0, 10.0, -2.0, 1.0 / 6.0],
    ]
)
"""The map from what a cubic lacks of value and three derivatives at 1 to the next four powers."""


@dataclass(frozen=True, eq=False)
class PosePath(CurvePath):
    """The joints that keep the tool on ``curve``.

    At `places` the joint angles and their first three derivatives are exact. Between two places
    each angle is the polynomial of seventh degree that they define; `CurveSearch` chooses the
    places so that it is off by less than 1e-10 rad.

    Attributes:
        chain: the arm with its tool.
        curve: the path of the tool.
        places: (K,) rising from 0 to 1.
        terms: (K - 1, 8, n) coefficients of each piece, from its own start, lowest power first.
        narrow: places at which joints turn so fast that the timing must look closely.
    """

    chain: Chain
    curve: Curve
    places: FloatArray
    terms: FloatArray
    narrow: tuple[float, ...] = ()
    _pieces: PiecewisePolynomial = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = np.size(self.places)
        places = finite_array(self.places, (count,), "The places of a path")
        terms = finite_array(self.terms, (count - 1, 8, self.chain.n), "The terms of a path")
        if count < 2 or places[0] != 0.0 or places[-1] != 1.0 or (np.diff(places) <= 0.0).any():
            raise InputError("The places of a path must rise from 0 to 1.")
        if self.curve.at(Jet.variable(0.0)).columns is None:
            raise InputError("The curve of a path of poses must have rotations.")
        object.__setattr__(self, "places", frozen(places))
        object.__setattr__(self, "terms", frozen(terms))
        pieces = PiecewisePolynomial(self.places[:-1].tolist(), self.terms, 1.0)
        object.__setattr__(self, "_pieces", pieces)

    @property
    def joins(self) -> tuple[float, ...]:
        """The joins of the curve, and the places at which the timing must look closely."""
        return tuple(sorted({*self.curve.joins, *self.narrow}))

    def joints(self, sigma: Jet) -> JointJets:
        """Return the joint angles [rad] at `sigma`, one place or many (N,)."""
        return self._pieces.at(sigma)

    def turned_off(self, sigma: FloatArray, q: FloatArray) -> FloatArray:
        """Return the angles (N,) [rad] between the tool at `q` (N, n) and at ``sigma`` (N,)."""
        wanted = self.curve.at(Jet.variable(sigma)).T
        if self.chain.n < 6:
            axis = self.chain.S[:3, 0]
            wanted[:, :3, :3] = [
                so3.exp(axis * angle) @ R
                for angle, R in zip(q[:, 0].tolist(), wanted[:, :3, :3], strict=True)
            ]
        pairs = zip(forward_batch(self.chain, q), wanted, strict=True)
        return np.array([so3.angle(one[:3, :3], other[:3, :3]) for one, other in pairs])


def septics(places: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the terms (K - 1, 8, n) of the polynomials of seventh degree between ``places`` (K,).

    ``left``, ``right``: (4, K - 1, n) value and three derivatives at the ends of each piece.
    """
    h = np.diff(places)[:, None]
    powers = h ** np.arange(8.0)[:, None, None]
    factors = np.array((1.0, 1.0, 2.0, 6.0))[:, None, None]
    low = left * powers[:4] / factors
    cubic = low[0] + low[1] + low[2] + low[3]
    lacking = np.stack(
        (
            right[0] - cubic,
            h * right[1] - (low[1] + 2.0 * low[2] + 3.0 * low[3]),
            h**2 * right[2] - (2.0 * low[2] + 6.0 * low[3]),
            h**3 * right[3] - 6.0 * low[3],
        )
    )
    high = np.einsum("ij,jkn->ikn", SEPTIC, lacking)
    terms: FloatArray = (np.concatenate((low, high)) / powers).transpose(1, 0, 2)
    return terms


class _Place(NamedTuple):
    """A place on the curve, and the posture there."""

    sigma: float
    posture: RegularPosture


@dataclass(frozen=True, eq=False)
class CurveSearch:
    """The search for the path of one arm along one curve.

    Attributes:
        equations: those of the arm.
        curve: the curve of its tool.
        q: (n,) joint angles at its start [rad].
        slope: (k,) how far the locked joints turn along the whole curve [rad].
    """

    equations: PoseEquations
    curve: Curve
    q: FloatArray
    slope: FloatArray

    def path(self) -> PosePath:
        """Return the path.

        Raises PathError where the arm cannot follow the curve: the place, why, and what to do.
        """
        places = self._places()
        path = self._exact(
            [place.sigma for place in places], np.array([place.posture.q for place in places])
        )
        self._refuse_limits(path)
        return path

    def _places(self) -> list[_Place]:
        last = self._at(0.0, self.q)
        if last is None or last.posture.least < WALL:
            raise self._refusal(0.0, None if last is None else last.posture)
        places, step, rate = [last], FIRST_STEP, np.zeros(len(self.q))
        marks = [*self.curve.joins, 1.0]
        while marks:
            checkpoint()
            last, end = places[-1], marks[0]
            # No sliver is left before a mark.
            sigma = end if last.sigma + 1.25 * step >= end else last.sigma + step
            following = self._at(sigma, last.posture.q + (sigma - last.sigma) * rate)
            if following is not None and self._leads(last.posture, following.posture):
                rate = (following.posture.q - last.posture.q) / (sigma - last.sigma)
                places.append(following)
                step = min(2.0 * step, FIRST_STEP)
                if sigma == end:
                    del marks[0]
                continue
            step = 0.5 * min(step, sigma - last.sigma)
            if step < LEAST_STEP:
                raise self._refusal(last.sigma, last.posture)
        return places

    @staticmethod
    def _leads(start: RegularPosture, end: RegularPosture) -> bool:
        """Return whether a step stays on the branch, clear of its edge, and turns no joint far."""
        return (
            end.least >= WALL
            and float(np.abs(end.q - start.q).max()) <= LARGEST_TURN
            and float(np.linalg.norm(end.matrix - start.matrix)) <= 0.5 * start.least
        )

    def _at(self, sigma: float, guess: FloatArray) -> _Place | None:
        """Return the place with the exact joints, from a guess (n,) of them; None without."""
        q = guess.copy()
        q[list(self.equations.locked)] = self._given(sigma)
        posture = self.equations.posture(q, self.curve.at(Jet.variable(sigma)).T[0])
        return None if posture is None else _Place(sigma, posture)

    def _given(self, sigma: float) -> FloatArray:
        angles: FloatArray = self.q[list(self.equations.locked)] + sigma * self.slope
        return angles

    def _exact(self, sigma: list[float], q: FloatArray) -> PosePath:
        """Return the path through the joints `q` (K, n) at ``sigma`` and more places."""
        places = np.array(sigma)
        for _ in range(ROUNDS):
            checkpoint()
            path = self._through(places, q)
            middle = 0.5 * (places[:-1] + places[1:])
            between = joint_derivatives(path, middle)[0]
            exact = self._derivatives(middle, between)[0]
            bad = np.abs(exact - between).max(axis=1) > BESIDE
            if not bad.any():
                break
            order = np.argsort(np.concatenate((places, middle[bad])))
            places = np.concatenate((places, middle[bad]))[order]
            q = np.concatenate((q, exact[bad]))[order]
        else:
            path = self._through(places, q)
        return path

    def _through(self, places: FloatArray, q: FloatArray) -> PosePath:
        # At a join the third derivative leaps: each piece takes that of its own side.
        ends = np.concatenate((places[:-1], np.nextafter(places[1:], 0.0)))
        d = self._derivatives(ends, np.concatenate((q[:-1], q[1:])))
        count = len(places) - 1
        terms = septics(places, d[:, :count], d[:, count:])
        shortest = float(np.diff(places).min())
        wanted = TIMED_PARTS / (LOOKS_PER_PIECE * shortest)
        more = int(np.ceil((wanted - TIMED_PIECES) / PIECES_OF_JOIN)) - len(self.curve.joins)
        narrow = np.linspace(0.0, 1.0, more + 2)[1:-1] if more > 0 else np.empty(0)
        chain = self.equations.chain
        return PosePath(chain, self.curve, frozen(places), frozen(terms), tuple(narrow.tolist()))

    def _derivatives(self, sigma: FloatArray, q: FloatArray) -> FloatArray:
        """Return the exact joints near `q` (N, n) at ``sigma`` and three derivatives, (4, N, n)."""
        pose = self.curve.at(Jet.variable(sigma))
        zeros = np.zeros_like(sigma)
        starts = self.q[list(self.equations.locked)].tolist()
        locked = [
            Jet(start + slope * sigma, zeros + slope, zeros, zeros)
            for start, slope in zip(starts, self.slope.tolist(), strict=True)
        ]
        joints = self.equations.solved(q, locked, pose)
        return np.stack([np.stack(joint.derivatives()) for joint in joints], axis=2)

    def _refuse_limits(self, path: PosePath) -> None:
        """Raise PathError where an axis exceeds its limit."""
        edges = np.linspace(path.places[:-1], path.places[1:], PARTS, endpoint=False).T.ravel()
        sigma = np.append(edges, 1.0)
        q, qd = joint_derivatives(path, sigma)[:2]
        refusal = limit_refusal(self.equations.chain, sigma, q, qd)
        if refusal is not None:
            place, why = refusal
            remedy = "Shift the path, give it another orientation, or begin on another branch."
            raise PathError(f"{why} {remedy}", self._point(place))

    def _refusal(self, sigma: float, near: RegularPosture | None) -> PathError:
        """Return the refusal of a curve that leads on from ``near``, at ``sigma``, to an edge."""
        where, point = at_place(sigma), self._point(sigma)
        if near is None:
            return PathError(f"The tool is not at the start of the path, {where}.", point)
        u, _, vt = np.linalg.svd(near.matrix)
        last = min(near.matrix.shape) - 1
        taking_part = np.flatnonzero(np.abs(vt[last]) > TAKES_PART).tolist()
        axes = [self.equations.free[k] + 1 for k in taking_part]
        if 1 not in axes and float(np.linalg.norm(u[-3:, last])) > MOSTLY:
            text = (
                f"The path leaves the reach of the arm {where}: its links come in line there. Keep "
                "the path nearer to the arm, or give it another orientation."
            )
        else:
            *first, end = map(str, axes)
            named = f"axes {', '.join(first)} and {end}" if first else f"axis {end}"
            text = (
                f"The path comes to a singularity {where}: {named} can turn together there without "
                "moving the tool, and would have to turn at once. Lead the path around that "
                "place, give it another orientation, or use `move`, which keeps to no line."
            )
        return PathError(text, point)

    def _point(self, sigma: float) -> list[float]:
        x, y, z = self.curve.at(Jet.variable(sigma)).target.position.tolist()
        return [x, y, z]
