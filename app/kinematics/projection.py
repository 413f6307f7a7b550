"""What the arm can do with an arbitrary pose: the nearest one it can take, and what it misses.

A pose has six freedoms, the arm five: its tool always lies in the vertical plane through axis 1.
Position comes first, exactly when it can be reached, else the nearest reachable point; then the
orientation, as near as possible in angle. All of it is in closed form: with theta1 set, the problem
is planar, its optimum is either free of every limit or has a joint on one, and each such case is a
meeting of two circles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray
from app.kinematics.arm import FiveAxisArm, arm_of
from app.kinematics.branch import BRANCHES, Branch
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.inverse import in_limits_turn
from app.kinematics.orientation import PlaneOrientation
from app.kinematics.planar import ANY_ANGLE, Interval, PlanarArm, Posture
from app.kinematics.subproblems import wrapped


@dataclass(frozen=True, eq=False)
class Projection:
    """The pose the arm takes in place of an asked one, and what is lost; every figure is measured.

    T: (4, 4) that pose T_S_tool. q: (5,) the joint angles [rad] that take it, on `branch`. Both
    arrays are read-only. position_error [m] and rotation_error [rad]: between the asked pose and
    `T`. yaw_error [rad]: between the asked tool's x axis and the arm's vertical plane, which no
    five-axis arm can follow. pitch_error [rad]: between the two tools' x axes within that plane.
    limits: indices (from 0) of the axes whose limit keeps the arm from coming nearer. reach: links
    in one line keep it from coming nearer.
    """

    T: FloatArray
    q: FloatArray
    branch: Branch
    position_error: float
    rotation_error: float
    yaw_error: float
    pitch_error: float
    limits: tuple[int, ...]
    reach: bool


class _Asked(NamedTuple):
    """The asked pose: tool point [m], and the rotation from the tool's orientation at home."""

    x: float
    y: float
    z: float
    R: FloatArray


class _Limits(NamedTuple):
    theta1: Interval
    theta2: Interval
    theta3: Interval
    theta4: Interval
    theta5: Interval


class _InPlane(NamedTuple):
    """A posture of the planar arm with a roll, and what kept either from the best orientation."""

    posture: Posture
    psi: float
    rotation_error: float
    posture_bound: bool
    roll_bound: bool


class _Wish(NamedTuple):
    """The orientation wanted in the plane, the roll allowed, and the roll [rad] now, if known."""

    orientation: PlaneOrientation
    roll: Interval
    roll_hint: float | None


_Search = Callable[[PlanarArm, float, float, _Wish], _InPlane | None]


class _Candidate(NamedTuple):
    q: tuple[float, float, float, float, float]
    branch: Branch
    position_error: float
    rotation_error: float
    theta1_bound: bool
    in_plane: _InPlane


def project(
    chain: Chain,
    T: npt.ArrayLike,
    *,
    branch: Branch | None = None,
    within_limits: bool = True,
    q_hint: npt.ArrayLike | None = None,
) -> Projection:
    """The feasible pose nearest to `T` (4, 4) = T_S_tool: in position, then in rotation angle.

    branch: the branch to stay on; None takes the one that comes nearest, and of equals the one
    nearest to `q_hint` (5,) [rad]. The hint also says which limit of axis 1 to wait at,
    which way to go on facing with the tool point on axis 1, and theta1 where the pose leaves it
    free. within_limits: keep every axis inside its limits. Every valid `T` has an answer.

    Raises InputError for a `T` or `q_hint` that cannot be used, RobotDescriptionError for an arm of
    another kind.
    """
    arm = arm_of(chain)
    T = se3.validated(T)
    hint = None if q_hint is None else chain.check_q(q_hint)
    x, y, z = T[:3, 3].tolist()
    asked = _Asked(x, y, z, T[:3, :3] @ chain.M[:3, :3].T)
    limits = _limits(chain) if within_limits else _Limits(*[ANY_ANGLE] * 5)
    candidates: list[_Candidate] = []
    for search in (_reaching, _approaching):
        for each in BRANCHES if branch is None else (branch,):
            candidates.extend(_candidates(arm, limits, asked, each, hint, search))
        if any(c.position_error <= tolerances.SAME_POSITION for c in candidates):
            break
    best = _nearest_candidate(candidates, hint)
    return _measured(chain, T, asked, best, within_limits)


def _limits(chain: Chain) -> _Limits:
    ends = zip(chain.lower.tolist(), chain.upper.tolist(), strict=True)
    return _Limits(*(Interval(lower, upper) for lower, upper in ends))


def _candidates(
    arm: FiveAxisArm,
    limits: _Limits,
    asked: _Asked,
    branch: Branch,
    hint: FloatArray | None,
    search: _Search,
) -> Iterator[_Candidate]:
    planar = _planar_arm(arm, limits, branch)
    for theta1, bound in _theta1(limits.theta1, asked, branch, hint):
        c, s = math.cos(theta1), math.sin(theta1)
        u, v = asked.x * c + asked.y * s, -asked.z
        wanted = PlaneOrientation.of(asked.R, theta1)
        hint5 = None if hint is None else float(hint[4])
        found = search(planar, u, v, _Wish(wanted, limits.theta5, hint5))
        if found is None:
            continue
        pu, pv = planar.tool(found.posture)
        yield _Candidate(
            q=(theta1, *found.posture[:3], found.psi),
            branch=branch,
            position_error=math.hypot(pu - u, pv - v, asked.y * c - asked.x * s),
            rotation_error=found.rotation_error,
            theta1_bound=bound,
            in_plane=found,
        )


def _planar_arm(arm: FiveAxisArm, limits: _Limits, branch: Branch) -> PlanarArm:
    """Axes 2 to 4 on `branch`: the elbow's side of the stretched arm, the shoulder's of axis 1."""
    lower, upper = max(limits.theta3.lower, -math.pi), min(limits.theta3.upper, math.pi)
    bend = Interval(0.0, upper) if branch.elbow == "up" else Interval(lower, 0.0)
    side = 1 if branch.shoulder == "front" else -1
    return PlanarArm(arm.l1, arm.l2, arm.l3, limits.theta2, bend, limits.theta4, side)


def _theta1(
    interval: Interval, asked: _Asked, branch: Branch, hint: FloatArray | None
) -> Iterator[tuple[float, bool]]:
    """The theta1 to try, and whether a limit holds it there.

    Off axis 1 the tool point's direction gives it. On it the plane must hold the tool's direction,
    which faces either way; with the tool along axis 1 too, nothing is asked of theta1.
    """
    if math.hypot(asked.x, asked.y) > tolerances.ON_AXIS:
        facing = math.atan2(asked.y, asked.x)
        angles = [facing if branch.shoulder == "front" else facing + math.pi]
    elif math.hypot(asked.R[0, 0], asked.R[1, 0]) > tolerances.ON_AXIS:
        facing = math.atan2(asked.R[1, 0], asked.R[0, 0])
        angles = [facing, facing + math.pi]
        if hint is not None:
            # Both ways put the tool there; turning round would be a motion nobody asked for.
            angles = [min(angles, key=lambda angle: abs(wrapped(angle - float(hint[0]))))]
        elif branch.shoulder == "back":
            angles.reverse()
    else:
        angles = [0.0 if hint is None else float(hint[0])]
    for angle in angles:
        theta1 = interval.fit(angle)
        if theta1 is not None:
            yield theta1, False
        elif hint is None:
            yield min(interval, key=lambda end: abs(wrapped(end - angle))), True
        else:
            yield min(interval, key=lambda end: abs(end - float(hint[0]))), True


def _reaching(planar: PlanarArm, u: float, v: float, wish: _Wish) -> _InPlane | None:
    """With the tool point at (u, v), or None.

    Behind axis 1, where the branch has no points, the nearest is straight across from (u, v) on it.
    """
    return _best_at(planar, u if u * planar.side >= 0.0 else 0.0, v, wish)


def _approaching(planar: PlanarArm, u: float, v: float, wish: _Wish) -> _InPlane:
    """With the tool point as near to (u, v) as it comes, when it cannot come there."""
    nearest = planar.nearest(u, v)
    held = _chosen(_rolled(nearest, wish), wish.roll_hint)
    # Where the edge of the workspace holds the arm the same posture comes back, off by the root of
    # rounding; only on axis 1 is the orientation free to improve.
    other = _best_at(planar, *planar.tool(nearest), wish)
    if other is None or other.rotation_error > held.rotation_error - tolerances.TOUCHING:
        return held
    return other._replace(posture_bound=True)


def _best_at(planar: PlanarArm, u: float, v: float, wish: _Wish) -> _InPlane | None:
    """The best orientation with the tool point at (u, v); None when no posture has it there.

    Either pitch and roll are both free and best; or the roll is at an end and the pitch best for
    it; or a joint is at an end and the roll best for that, or at its own end.
    """
    wanted, roll, hint = wish
    phi, psi = wanted.best()
    posture = planar.at(u, v, phi)
    free_roll = roll.fit(psi)
    if posture is not None and free_roll is not None:
        return _InPlane(posture, free_roll, wanted.angle(phi, psi), False, False)
    found: list[_InPlane] = []
    for end in roll.ends:
        posture = planar.at(u, v, wanted.best_pitch(end))
        if posture is not None:
            found.append(_InPlane(posture, end, wanted.angle(posture.phi, end), False, True))
    for posture in planar.pitch_ends(u, v):
        found.extend(_rolled(posture, wish))
    return _chosen(found, hint) if found else None


def _rolled(posture: Posture, wish: _Wish) -> list[_InPlane]:
    """`posture` with the roll best for its pitch, or with each end of the roll."""
    wanted, roll, _ = wish
    best = roll.fit(wanted.best_roll(posture.phi))
    rolls = roll.ends if best is None else (best,)
    return [
        _InPlane(posture, psi, wanted.angle(posture.phi, psi), True, best is None) for psi in rolls
    ]


def _chosen(found: list[_InPlane], roll_hint: float | None) -> _InPlane:
    least = min(each.rotation_error for each in found) + tolerances.SAME_ROTATION
    equal = [each for each in found if each.rotation_error <= least]
    return equal[0] if roll_hint is None else min(equal, key=lambda e: abs(e.psi - roll_hint))


def _nearest_candidate(remaining: list[_Candidate], hint: FloatArray | None) -> _Candidate:
    least = min(c.position_error for c in remaining) + tolerances.SAME_POSITION
    remaining = [c for c in remaining if c.position_error <= least]
    least = min(c.rotation_error for c in remaining) + tolerances.SAME_ROTATION
    remaining = [c for c in remaining if c.rotation_error <= least]
    if hint is None:
        return remaining[0]
    return min(remaining, key=lambda c: float(np.abs(hint - c.q).max()))


def _measured(
    chain: Chain, T: FloatArray, asked: _Asked, best: _Candidate, within_limits: bool
) -> Projection:
    q = in_limits_turn(chain, np.array(best.q))
    reached = forward(chain, q)
    q.setflags(write=False)
    reached.setflags(write=False)
    c, s = math.cos(q[0]), math.sin(q[0])
    dx, dy, dz = asked.R[:, 0].tolist()
    outward, sideways = c * dx + s * dy, c * dy - s * dx
    flat = math.hypot(outward, dz)
    pitch_error = abs(wrapped(float(q[1] + q[2] + q[3]) - math.atan2(-dz, outward)))
    in_plane = best.in_plane
    return Projection(
        T=reached,
        q=q,
        branch=best.branch,
        position_error=math.dist(reached[:3, 3], T[:3, 3]),
        rotation_error=so3.angle(reached[:3, :3], T[:3, :3]),
        yaw_error=math.atan2(abs(sideways), flat),
        pitch_error=pitch_error if flat > tolerances.ON_AXIS else 0.0,
        limits=tuple(_binding(chain, q, best)) if within_limits else (),
        reach=in_plane.posture_bound and in_plane.posture.stretched,
    )


def _binding(chain: Chain, q: FloatArray, best: _Candidate) -> Iterator[int]:
    held = best.in_plane.posture_bound
    may_bind = (best.theta1_bound, held, held, held, best.in_plane.roll_bound)
    for i, bound in enumerate(may_bind):
        gap = min(abs(float(q[i] - chain.lower[i])), abs(float(q[i] - chain.upper[i])))
        if bound and gap <= tolerances.LIMIT_SLACK:
            yield i
