"""What the arm can do with an arbitrary pose: the nearest one it can take, and what it misses.

A pose has six freedoms, the arm five: its roll axis always lies in the plane that turns with axis
1. Position comes first, exactly when it can be reached, else the nearest reachable point; then the
orientation, as near as possible in angle. It is in closed form on the canonical arm: with theta1
set, the problem is planar, its optimum is either free of every limit or has a joint on one, and
each such case is a meeting of two circles. Only where the plane passes beside axis 1 and the point
is out of reach do theta1 and the posture depend on each other; they are then found in turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray
from app.kinematics.arm import Five, FiveAxisArm, arm_of
from app.kinematics.branch import BRANCHES, Branch
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.orientation import PlaneOrientation
from app.kinematics.planar import ANY_ANGLE, Interval, PlanarArm, Posture
from app.kinematics.turns import in_limits_turn, nearest_turn, wrapped

_TURNS: Final = 100
"""Most steps of the iterations that end by themselves, each step much nearer than the last."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The pose the arm takes in place of an asked one, and what is lost; every figure is measured.

    T: (4, 4) that pose T_S_tool. q: (5,) the joint angles [rad] that take it, on `branch`. Both
    arrays are read-only. position_error [m] and rotation_error [rad]: between the asked pose and
    `T`. yaw_error [rad]: between the asked tool's roll axis and the arm's plane, which no five-axis
    arm can follow. pitch_error [rad]: between the two roll axes within that plane.
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
    """The asked pose T_C_K: its point [m], its x axis seen from above, its orientation."""

    x: float
    y: float
    z: float
    along_x: float
    along_y: float
    orientation: PlaneOrientation

    @staticmethod
    def of(T_C_K: FloatArray) -> _Asked:
        x, y, z = T_C_K[:3, 3].tolist()
        along_x, along_y = T_C_K[:2, 0].tolist()
        return _Asked(x, y, z, along_x, along_y, PlaneOrientation.of(T_C_K[:3, :3]))


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


class _Candidate(NamedTuple):
    alpha: Five
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
    hint = None if q_hint is None else chain.check_q(q_hint)
    problem = _problem(chain, within_limits)
    T = se3.validated(T)
    T_C_K = problem.arm.pose(T)
    best = _measured(problem, T, T_C_K, _solved(problem, _Asked.of(T_C_K), branch, hint), hint)
    if problem.arm.off_axis > 0.0:
        return _shifted(problem, T, T_C_K, best, branch, hint)
    return best


def planar_arms(chain: Chain, branch: Branch) -> tuple[PlanarArm, ...]:
    """Axes 2 to 4 of `chain` inside the limits on `branch`, a piece each; none where it is void."""
    return _problem(chain, True).planar.get(branch, ())


class _Problem(NamedTuple):
    """What does not change from pose to pose: the arm, and its limits as canonical angles."""

    chain: Chain
    arm: FiveAxisArm
    within_limits: bool
    theta1: Interval
    theta5: Interval
    planar: Mapping[Branch, tuple[PlanarArm, ...]]
    void: Mapping[Branch, tuple[PlanarArm, ...]]


@lru_cache(maxsize=64)
def _problem(chain: Chain, within_limits: bool) -> _Problem:
    arm = arm_of(chain)
    limits = [ANY_ANGLE] * 5
    if within_limits:
        ends = np.sort((arm.canonical(chain.lower), arm.canonical(chain.upper)), axis=0)
        limits = [Interval(lower, upper) for lower, upper in ends.T.tolist()]
    planar: dict[Branch, tuple[PlanarArm, ...]] = {}
    void: dict[Branch, tuple[PlanarArm, ...]] = {}
    for branch in BRANCHES:
        bend = 1 if branch.elbow == "up" else -1
        side = 1 if branch.shoulder == "front" else -1
        pieces = _bends(limits[2], bend)
        arms = tuple(
            PlanarArm(arm.l1, arm.l2, arm.l3, limits[1], piece, limits[3], sign, -arm.a, side)
            for sign, piece in pieces or _least_bend(limits[2], -bend)
        )
        (planar if pieces else void)[branch] = arms
    return _Problem(chain, arm, within_limits, limits[0], limits[4], planar, void)


def _bends(theta3: Interval, bend: int) -> list[tuple[int, Interval]]:
    """The parts of `theta3` on one side of the stretched and of the folded arm."""
    if theta3 == ANY_ANGLE:
        theta3 = Interval(-math.pi, math.pi)
    half_turns = range(math.floor(theta3.lower / math.pi), math.ceil(theta3.upper / math.pi))
    return [
        (bend, Interval(max(theta3.lower, k * math.pi), min(theta3.upper, (k + 1) * math.pi)))
        for k in half_turns
        if (k % 2 == 0) == (bend > 0)
    ]


def _least_bend(theta3: Interval, bend: int) -> list[tuple[int, Interval]]:
    """Where the limits leave nothing of the other elbow: the end nearest to it."""
    end = min(theta3, key=lambda theta: abs(math.sin(theta)))
    return [(bend, Interval(end, end))]


def _solved(
    problem: _Problem, asked: _Asked, branch: Branch | None, hint: FloatArray | None
) -> _Candidate:
    canonical = None if hint is None else tuple(problem.arm.canonical(hint).tolist())
    if branch is None:
        planar = [(each, arm) for each, arms in problem.planar.items() for arm in arms]
    else:
        arms = problem.planar.get(branch) or problem.void[branch]
        planar = [(branch, arm) for arm in arms]
    candidates: list[_Candidate] = []
    for approaching in (False, True):
        for each, arm in planar:
            candidates.extend(_candidates(problem, asked, each, arm, canonical, approaching))
        if any(c.position_error <= tolerances.SAME_POSITION for c in candidates):
            break
    return _nearest_candidate(candidates, canonical)


def _candidates(
    problem: _Problem,
    asked: _Asked,
    branch: Branch,
    planar: PlanarArm,
    hint: Five | None,
    approaching: bool,
) -> Iterator[_Candidate]:
    arm = problem.arm
    search = _approaching if approaching else _reaching
    for first, first_bound in _theta1(problem.theta1, arm.d, asked, branch, hint):
        theta1, bound = first, first_bound
        for _ in range(_TURNS):
            c, s = math.cos(theta1), math.sin(theta1)
            u, v = asked.x * c + asked.y * s - arm.a, -asked.z
            wanted = asked.orientation.seen_from(theta1).tilted(arm.tilt)
            wish = _Wish(wanted, problem.theta5, None if hint is None else hint[4])
            found = search(planar, u, v, wish)
            if found is None:
                break
            pu, pv = planar.tool(found.posture)
            if bound or not approaching or arm.d == 0.0:
                break
            # The tool point at pu is nearest to the asked one with theta1 turned to face it so.
            aligned = _aligned(asked, arm.d, pu + arm.a)
            if abs(wrapped(aligned - theta1)) <= tolerances.ALIGNED:
                break
            theta1, bound = _fitted(problem.theta1, aligned)
        if found is not None:
            yield _Candidate(
                alpha=(theta1, *found.posture[:3], found.psi),
                branch=branch,
                position_error=math.hypot(pu - u, pv - v, asked.y * c - asked.x * s - arm.d),
                rotation_error=found.rotation_error,
                theta1_bound=bound,
                in_plane=found,
            )


def _theta1(
    interval: Interval, d: float, asked: _Asked, branch: Branch, hint: Five | None
) -> Iterator[tuple[float, bool]]:
    """The theta1 to try, and whether a limit holds it there.

    Off axis 1 the tool point's direction gives it. On it the plane must hold the tool's direction,
    which faces either way; with the tool along axis 1 too, nothing is asked of theta1.
    """
    rho = math.hypot(asked.x, asked.y)
    if rho > tolerances.ON_AXIS:
        u = math.sqrt(max(rho - abs(d), 0.0) * (rho + abs(d)))
        angles = [_aligned(asked, d, u if branch.shoulder == "front" else -u)]
    elif math.hypot(asked.along_x, asked.along_y) > tolerances.ON_AXIS:
        facing = math.atan2(asked.along_y, asked.along_x)
        angles = [facing, facing + math.pi]
        if hint is not None:
            # Both ways put the tool there; turning round would be a motion nobody asked for.
            angles = [min(angles, key=lambda angle: abs(wrapped(angle - hint[0])))]
        elif branch.shoulder == "back":
            angles.reverse()
    else:
        angles = [0.0 if hint is None else hint[0]]
    for angle in angles:
        theta1, bound = _fitted(interval, angle)
        if bound and hint is not None:
            theta1 = min(interval, key=lambda end: abs(end - hint[0]))
        yield theta1, bound
        if bound and hint is None and d != 0.0:
            # Beside axis 1 the end farther in angle may come nearer.
            yield sum(interval) - theta1, True


def _aligned(asked: _Asked, d: float, u: float) -> float:
    """The theta1 that turns a tool point at `u` outward, `d` sideways towards the asked one."""
    return math.atan2(asked.y, asked.x) - math.atan2(d, u)


def _fitted(interval: Interval, theta: float) -> tuple[float, bool]:
    """`theta` if the interval holds it, else its nearer end, and whether it had to be."""
    fitted = interval.fit(theta)
    if fitted is not None:
        return fitted, False
    return min(interval, key=lambda end: abs(wrapped(end - theta))), True


def _reaching(planar: PlanarArm, u: float, v: float, wish: _Wish) -> _InPlane | None:
    """With the tool point at (u, v), or None.

    Behind axis 1, where the branch has no points, the nearest is straight across from (u, v) on it.
    """
    return _best_at(planar, planar.axis if planar.behind(u) > 0.0 else u, v, wish)


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


def _nearest_candidate(remaining: list[_Candidate], hint: Five | None) -> _Candidate:
    least = min(c.position_error for c in remaining) + tolerances.SAME_POSITION
    remaining = [c for c in remaining if c.position_error <= least]
    least = min(c.rotation_error for c in remaining) + tolerances.SAME_ROTATION
    remaining = [c for c in remaining if c.rotation_error <= least]
    if hint is None:
        return remaining[0]
    return min(remaining, key=lambda c: max(abs(a - b) for a, b in zip(hint, c.alpha, strict=True)))


def _measured(
    problem: _Problem, T: FloatArray, T_C_K: FloatArray, best: _Candidate, hint: FloatArray | None
) -> Projection:
    chain, arm, in_plane = problem.chain, problem.arm, best.in_plane
    q = arm.joints(best.alpha)
    q = np.clip(q, chain.lower, chain.upper) if problem.within_limits else in_limits_turn(chain, q)
    q = nearest_turn(chain, q, hint)
    reached = forward(chain, q)
    q.setflags(write=False)
    reached.setflags(write=False)
    one, two, three, four, _ = best.alpha
    c, s = math.cos(one), math.sin(one)
    dx, dy, dz = T_C_K[:3, 0].tolist()
    outward, sideways = c * dx + s * dy, c * dy - s * dx
    flat = math.hypot(outward, dz)
    pitch_error = abs(wrapped(two + three + four - arm.tilt - math.atan2(-dz, outward)))
    return Projection(
        T=reached,
        q=q,
        branch=best.branch,
        position_error=math.dist(reached[:3, 3], T[:3, 3]),
        rotation_error=so3.angle(reached[:3, :3], T[:3, :3]),
        yaw_error=math.atan2(abs(sideways), flat),
        pitch_error=pitch_error if flat > tolerances.ON_AXIS else 0.0,
        limits=tuple(_binding(chain, q, best)) if problem.within_limits else (),
        reach=in_plane.posture_bound and in_plane.posture.stretched,
    )


def _binding(chain: Chain, q: FloatArray, best: _Candidate) -> Iterator[int]:
    held = best.in_plane.posture_bound
    may_bind = (best.theta1_bound, held, held, held, best.in_plane.roll_bound)
    for i, bound in enumerate(may_bind):
        gap = min(abs(float(q[i] - chain.lower[i])), abs(float(q[i] - chain.upper[i])))
        if bound and gap <= tolerances.LIMIT_SLACK:
            yield i


def _shifted(
    problem: _Problem,
    T: FloatArray,
    T_C_K: FloatArray,
    best: Projection,
    branch: Branch | None,
    hint: FloatArray | None,
) -> Projection:
    """The projection of a tool point beside the roll axis, from that of the point on the axis.

    The two part by what the orientation misses, so the point on the axis is moved by that and the
    rest solved again, as long as the tool point comes nearer. It ends on the asked point where the
    arm reaches it; beyond reach it ends near the nearest one, not always on it.
    """
    aim = np.array(T_C_K)
    R_C_S = problem.arm.T_C_S[:3, :3]
    reached = best
    for _ in range(_TURNS):
        if reached.position_error <= tolerances.SAME_POSITION * 1e-3:
            break
        aim[:3, 3] += R_C_S @ (T[:3, 3] - reached.T[:3, 3])
        candidate = _solved(problem, _Asked.of(aim), branch, hint)
        reached = _measured(problem, T, T_C_K, candidate, hint)
        if reached.position_error >= best.position_error:
            break
        best = reached
    return best
