"""The posture inside the limits whose pose is nearest to a target, with the reason in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.arm.control.state.findings import causes_of, of_projection
from katana450.arm.control.state.messages import REASONS
from katana450.arm.control.state.state import Finding, Reason
from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.numerical import search_of
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.pose import check_metres
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
    project,
)
from katana450.maths.kinematics.solution import Solution, scaled_jacobian
from katana450.maths.kinematics.turns import nearest_turn

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
class NearestPose(Projection):
    """The feasible pose nearest to a target, and the remaining errors; all of them are measured.

    Yaw, pitch and roll are those of a five-axis arm, which cannot take every orientation. They are
    0 for other arms.

    Attributes:
        T: (4, 4) the feasible pose, in the frame of the arm object [m].
        q: (n,) joint angles that take it [rad].
        branch: the branch of ``q``.
        position_error: distance from the target [m].
        rotation_error: angle from the target [rad].
        yaw_error: angle between the target's roll axis and the arm's plane, which a 5-axis arm
            cannot leave [rad].
        pitch_error: angle between the two roll axes within that plane [rad].
        roll_error: missing roll where the pitch has priority [rad].
        limits: indices, from 0, of the axes whose limit keeps the arm from coming nearer.
        axis1: whether axis 1 keeps the arm from coming nearer.
        reach: whether the links are too short to come nearer.
        reason: the same in words; empty if the target is met within the precision of the arm.
    """

    reason: str = ""


def nearest_pose(
    kinematics: Kinematics,
    T: npt.ArrayLike,
    *,
    priority: Priority = Priority.POSE,
    branch: AnyBranch | None = None,
    q_hint: npt.ArrayLike | None = None,
    within_limits: bool = True,
    yaw_counts: bool = True,
) -> NearestPose:
    """Return the pose nearest to `T` (4, 4) = T_S_tool [m] that the arm can take, with the reason.

    Of equally good postures it is the one nearest to `q_hint` (n,) [rad]. Arms outside the
    five-axis family have the priority POSE, and choose their branch. `yaw_counts`: whether the
    reason mentions a missing yaw.

    Raises InputError for an invalid argument, and for a pose whose unit is in doubt.
    """
    chain, target = kinematics.chain, se3.validated(T)
    check_metres(chain, target[:3, 3].tolist())
    if kinematics.is_pitched:
        best = project(
            chain,
            target,
            branch=None if branch is None else Branch.parse(str(branch)),
            within_limits=within_limits,
            q_hint=q_hint,
            priority=priority,
        )
        has_yaw = yaw_counts and priority is Priority.POSE
        findings = of_projection(chain, best, priority, yaw_was_given=has_yaw)
    elif priority is not Priority.POSE or branch is not None:
        raise InputError(
            "Other priorities than 'pose', and one branch, are for five-axis arms. The kinematics "
            f"of this arm are {kinematics.method}; its inverse kinematics return its branches."
        )
    else:
        best = nearest_posture(kinematics, target, q_hint=q_hint, within_limits=within_limits)
        findings = tuple(losses_of(chain, best, priority, at_edge=False))
    reason = "; ".join(REASONS[finding.reason](finding) for finding in findings)
    return NearestPose(
        **{field.name: getattr(best, field.name) for field in fields(best)}, reason=reason
    )


def nearest_posture(
    kinematics: Kinematics,
    T: FloatArray,
    *,
    q_hint: npt.ArrayLike | None = None,
    within_limits: bool = True,
) -> Projection:
    """Return the posture nearest to the pose `T` (4, 4) of an arm outside the five-axis family.

    Of postures that take the pose, the one nearest to `q_hint` (n,) [rad] is returned, or without
    hint the one with the most room to the limits. If none takes it, the position counts first, then
    the orientation. Raises InputError for an invalid `q_hint`.
    """
    chain = kinematics.chain
    solutions = kinematics.inverse(T, q_hint)
    usable = [solution for solution in solutions if solution.within_limits or not within_limits]
    exact = [solution for solution in usable if solution.exact]
    hint = None if q_hint is None else chain.check_q(q_hint)
    if exact:
        best = min(exact, key=lambda solution: _cost(chain, solution.q, hint))
    else:
        if within_limits:
            usable += _searched(chain, T, solutions, q_hint)
        best = min(
            usable,
            key=lambda solution: (round(solution.position_error, 6), solution.rotation_error),
        )
    q = nearest_turn(chain, best.q, hint)
    return projected(chain, q, T, best.branch, Priority.POSE, bounded=within_limits)


def _searched(
    chain: Chain, T: FloatArray, solutions: Iterable[Solution], q_hint: npt.ArrayLike | None
) -> list[Solution]:
    """Return postures inside the limits that searches from ``solutions`` and the hint lead to."""
    search = search_of(chain)
    starts = [chain.clamp(solution.q) for solution in solutions]
    if q_hint is not None:
        starts.insert(0, chain.clamp(q_hint))
    ends: list[Solution] = []
    for weight in (POSITION_FIRST, POSITION_ALONE):
        q = search.nearest(T, starts, weight)
        ends.append(Solution(chain, T, tuple(q), search.branches[0]))
        if ends[-1].position_error <= POSITION_WORTH_TELLING:
            break
        starts = [q, *starts]
    return ends


def _cost(chain: Chain, q: FloatArray, hint: FloatArray | None) -> float:
    if hint is not None:
        return float(np.abs(q - hint).max())
    room = np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    return -float(room.min())


def projected(
    chain: Chain,
    q: FloatArray,
    T: FloatArray,
    branch: AnyBranch,
    priority: Priority,
    *,
    bounded: bool = True,
) -> Projection:
    """Return the projection of the pose `T` (4, 4) that the joint angles `q` (n,) [rad] give.

    ``bounded``: whether the limits of the joints count.
    """
    reached = forward(chain, q)
    position = math.dist(reached[:3, 3], T[:3, 3])
    rotation = so3.angle(reached[:3, :3], T[:3, :3])
    turned_off = priority is not Priority.POSITION and rotation > ANGLE_WORTH_TELLING
    missed = position > POSITION_WORTH_TELLING or turned_off
    limits = held_by(chain, np.asarray(q), reached, T) if missed and bounded else ()
    return Projection(
        T=frozen(reached),
        q=frozen(q),
        branch=branch,
        position_error=position,
        rotation_error=rotation,
        limits=limits,
        reach=position > POSITION_WORTH_TELLING
        and (
            is_beyond_links(chain, T)
            or (not limits and is_complete(chain) and is_stuck(chain, np.asarray(q), reached, T))
        ),
    )


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


def is_beyond_links(chain: Chain, target: FloatArray) -> bool:
    """Return whether the tool point of the target (4, 4) is farther away than the links reach."""
    return math.dist(screws.point_on(chain.S[:, 0]), target[:3, 3]) > chain.reach


def is_complete(chain: Chain) -> bool:
    """Return whether all postures of a pose are known; a search may end where it is not nearest."""
    return len(kinematics_of(chain).branches) > 1


def is_stuck(chain: Chain, q: FloatArray, reached: FloatArray, target: FloatArray) -> bool:
    """Return whether no small motion from `q` (n,) [rad] inside the limits leads clearly nearer."""
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


def losses_of(
    chain: Chain,
    best: Projection,
    priority: Priority,
    *,
    at_edge: bool,
    gap: tuple[int, float] | None = None,
) -> Iterator[Finding]:
    """Yield the findings on ``best``, most useful first.

    ``at_edge``: whether its posture is at the edge of its branch. ``gap``: the axis that would
    leap, from 0, and the angle of its leap [rad], if only a leap leads nearer.
    """
    off = best.position_error > POSITION_WORTH_TELLING
    turned = priority is not Priority.POSITION and best.rotation_error > ANGLE_WORTH_TELLING
    if gap is not None:
        yield Finding(Reason.ACROSS_GAP, gap[1], gap[0])
    if off:
        gives_way = priority is Priority.ORIENTATION and not turned
        # It is out of reach only if that is shown: by the links, or by a limit.
        is_shown = best.reach or (best.limits and is_complete(chain))
        gives_way = gives_way or gap is not None or not is_shown
        reason = Reason.POSITION_CHANGED if gives_way else Reason.OUT_OF_REACH
        yield Finding(reason, best.position_error)
    if turned:
        yield Finding(Reason.ORIENTATION_CHANGED, best.rotation_error)
    if (off or turned) and gap is None:
        yield from causes_of(chain, best, at_edge=at_edge)
