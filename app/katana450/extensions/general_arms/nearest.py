"""The posture inside the limits whose pose is nearest to a target, with the reason in words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.arm.control.messages import REASONS
from katana450.arm.control.state import Finding, Reason
from katana450.extensions.general_arms.links import links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.projection import ANGLE_WORTH_TELLING, POSITION_WORTH_TELLING
from katana450.maths.kinematics.solution import Solution, scaled_jacobian

POSITION_FIRST = 100.0
"""Weight of the position relative to the orientation if a pose cannot be reached."""

POSITION_ALONE = 1e4
"""The same where a posture gives up some of the position for the orientation."""

AT_LIMIT = 1e-6
"""[rad] Distance from a limit within which a joint counts as held by it."""

APPROACH = 0.1
"""[rad] Largest turn of a joint in the motion that shows whether a target is out of reach."""

DAMPING = 1e-2
"""[1] Damping of that motion, relative to the longest arm of a joint."""

CLEARLY = 0.1
"""[1] Part of the distance by which that motion brings a tool nearer that can come nearer."""


@dataclass(frozen=True, eq=False)
class BestPosture:
    """The posture that comes nearest to a target; all errors are measured.

    Attributes:
        q: (n,) joint angles [rad].
        T: (4, 4) the pose that they take [m].
        branch: name of its branch, or "numerical".
        position_error: distance from the target [m].
        rotation_error: angle from the target [rad].
        limits: indices, from 0, of the axes whose limit keeps the arm from coming nearer.
        reason: why it comes no nearer, in words; empty if the target is met.
    """

    q: FloatArray
    T: FloatArray
    branch: str
    position_error: float
    rotation_error: float
    limits: tuple[int, ...]
    reason: str


def nearest_posture(
    kinematics: Kinematics,
    T: npt.ArrayLike,
    *,
    q_hint: npt.ArrayLike | None = None,
    within_limits: bool = True,
) -> BestPosture:
    """Return the posture nearest to the pose `T` (4, 4) = T_S_tool [m].

    Of postures that take the pose, the one nearest to `q_hint` (n,) [rad] is returned, or without
    hint the one with the most room to the limits. If none takes it, the position counts first, then
    the orientation. Raises InputError for an invalid `T` or `q_hint`.
    """
    chain, target = kinematics.chain, se3.validated(T)
    found = kinematics.inverse(T, q_hint)
    usable = [each for each in found if each.within_limits or not within_limits]
    exact = [each for each in usable if each.exact]
    if exact:
        hint = None if q_hint is None else chain.check_q(q_hint)
        best = min(exact, key=lambda each: _cost(chain, each.q, hint))
        return _described(chain, target, best.q, str(best.branch), is_free=not within_limits)
    if within_limits:
        search = _search(chain)
        starts = [chain.clamp(each.q) for each in found]
        if q_hint is not None:
            starts.insert(0, chain.clamp(q_hint))
        for weight in (POSITION_FIRST, POSITION_ALONE):
            q = search.nearest(target, starts, weight)
            posture = Solution(chain, target, tuple(q), "numerical")
            usable = [*usable, posture]
            if posture.position_error <= POSITION_WORTH_TELLING:
                break
            starts = [q, *starts]
    best = min(usable, key=_errors)
    return _described(chain, target, best.q, str(best.branch), is_free=not within_limits)


def _errors(posture: Solution) -> tuple[float, float]:
    return round(posture.position_error, 6), posture.rotation_error


def _cost(chain: Chain, q: FloatArray, hint: FloatArray | None) -> float:
    if hint is not None:
        return float(np.abs(q - hint).max())
    room = np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    return -float(room.min())


def _described(
    chain: Chain, target: FloatArray, q: FloatArray, branch: str, *, is_free: bool
) -> BestPosture:
    reached = forward(chain, q)
    position = math.dist(reached[:3, 3], target[:3, 3])
    rotation = so3.angle(reached[:3, :3], target[:3, :3])
    missed = position > POSITION_WORTH_TELLING or rotation > ANGLE_WORTH_TELLING
    limits = held_by(chain, q, reached, target) if missed and not is_free else ()
    words = []
    if position > POSITION_WORTH_TELLING:
        words.append(REASONS[Reason.OUT_OF_REACH](Finding(Reason.OUT_OF_REACH, position)))
    if rotation > ANGLE_WORTH_TELLING:
        words.append(f"its rotation is {math.degrees(rotation):.3g}° off")
    for axis in limits:
        end = min(chain.lower[axis], chain.upper[axis], key=lambda end: abs(end - q[axis]))
        words.append(REASONS[Reason.AXIS_LIMIT](Finding(Reason.AXIS_LIMIT, float(end), axis)))
    if missed and not limits:
        if position > POSITION_WORTH_TELLING:
            words.append(REASONS[Reason.LINKS](Finding(Reason.LINKS)))
        elif chain.n < 6:
            words.append(f"{chain.n} axes cannot take every pose")
    return BestPosture(q, reached, branch, position, rotation, limits, "; ".join(words))


def held_by(
    chain: Chain, q: FloatArray, reached: FloatArray, target: FloatArray
) -> tuple[int, ...]:
    """Return the axes at a limit that would bring the tool nearer beyond it."""
    J = scaled_jacobian(chain, q)
    twist = so3.log(target[:3, :3] @ reached[:3, :3].T)
    gap = target[:3, 3] - reached[:3, 3]
    pull = J[:3].T @ twist / POSITION_FIRST + J[3:].T @ gap
    high, low = q >= chain.upper - AT_LIMIT, q <= chain.lower + AT_LIMIT
    return tuple(np.flatnonzero((high & (pull > 0.0)) | (low & (pull < 0.0))).tolist())


def is_out_of_reach(chain: Chain, q: FloatArray, reached: FloatArray, target: FloatArray) -> bool:
    """Return whether it is shown that the links keep the tool point from the target (4, 4).

    The target is farther away than their lengths, or no small motion from `q` (n,) [rad] inside the
    limits brings the tool point clearly nearer.
    """
    if math.dist(screws.point_on(chain.S[:, 0]), target[:3, 3]) > chain.reach:
        return True
    J = jacobian_space(chain, q)
    v = J[3:] + np.cross(J[:3], reached[:3, 3], axis=0)
    gap = target[:3, 3] - reached[:3, 3]
    pull = v.T @ gap
    v[:, ((q >= chain.upper) & (pull > 0.0)) | ((q <= chain.lower) & (pull < 0.0))] = 0.0
    length = max(float(np.linalg.norm(v, axis=0).max()), tolerances.ON_AXIS)
    dq = v.T @ np.linalg.solve(v @ v.T + (DAMPING * length) ** 2 * np.eye(3), gap)
    dq *= min(1.0, APPROACH / max(float(np.abs(dq).max()), APPROACH))
    before = float(np.linalg.norm(gap))
    after = math.dist(forward(chain, chain.clamp(q + dq))[:3, 3], target[:3, 3])
    return before - after <= CLEARLY * min(before, APPROACH * length)


@lru_cache(maxsize=64)
def _search(chain: Chain) -> Numerical:
    return Numerical(chain, links_of(chain, exact=False))
