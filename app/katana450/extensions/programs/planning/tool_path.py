"""A joint path that keeps the tool on a curve, computed at every place without interpolation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from katana450 import tolerances
from katana450.arm.control.messages import axis_names
from katana450.errors import PathError
from katana450.extensions.programs.planning.curves import Curve
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.limited import LimitedArm
from katana450.maths.kinematics.nearest_posture import nearest_posture
from katana450.maths.kinematics.priority import Priority
from katana450.maths.planning.jet import Coefficient, Jet
from katana450.maths.planning.path import CurvePath
from katana450.maths.planning.posture import FiveJets, posture

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
        found = []
        for axis, (angle, sign, shift) in enumerate(zip(alpha, arm.signs, arm.shifts, strict=True)):
            q = sign * (angle - shift) if sign != 1.0 or shift else angle
            turns = self._turn(axis, sigma.c0, q.c0)
            found.append(q + turns * math.tau if np.any(turns) else q)
        one, two, three, four, five = found
        return one, two, three, four, five

    def _in_turn(self, q: FloatArray) -> FloatArray:
        """Return the angles `q` (5,) [rad], known up to whole turns, as the path starts at them."""
        lower, upper, slack = self.chain.lower, self.chain.upper, tolerances.LIMIT_SLACK
        near, inside = (
            q + np.rint((there - q) / math.tau) * math.tau
            for there in (self.near, 0.5 * (lower + upper))
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
            q = np.stack([np.broadcast_to(each.c0, sigma.shape) for each in alpha], axis=1)
            qd = np.stack([np.broadcast_to(each.c1, sigma.shape) for each in alpha], axis=1)
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
            place, axis = (int(each) for each in np.argwhere(kinked)[0])
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
    return first, (
        f"The path takes axis {axis + 1}, {axis_names(chain.names)[axis]}, over its limit of "
        f"{np.degrees(limit):.1f} deg {at_place(first)}, by up to {np.degrees(worst):.3g} deg "
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
    found = a
    with np.errstate(divide="ignore", invalid="ignore"):
        for t in (da / divisor, divisor / (3.0 * f)):
            inside = turns & (t > 0.0) & (t < 1.0)
            t_in = np.where(inside, t, 0.0)
            found = np.where(inside, a + t_in * (da + t_in * (e + t_in * f)), found)
    return found
