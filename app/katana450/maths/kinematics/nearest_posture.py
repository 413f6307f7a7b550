"""The posture of the arm nearest to a target: position first, then the orientation.

The solution is in closed form on the canonical arm. With theta1 set, the problem is planar: a
posture of axes 2 to 4, and a roll. Its optimum is either free of every limit or has a joint on one,
and each such case is an intersection of two circles. theta1 and the posture depend on each other
only where the plane passes beside axis 1 and the point is out of reach; they are then found
alternately. Lengths in m, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

from katana450 import tolerances
from katana450.maths.kinematics.arm import Five
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget, PlaneOrientation
from katana450.maths.kinematics.planar import Interval, LimitedArm, PlanarArm, Posture, directions
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.turns import wrapped

_Angles = tuple[float, float]
"""The angles theta2 and theta3; theta4 is the remainder of the pitch."""


def nearest_at_pitch(planar: PlanarArm, u: float, v: float, phi: float) -> Posture | None:
    """Return the posture with pitch `phi` whose tool point is nearest to (u, v), or None.

    None means that no posture has this pitch. A fixed pitch leaves the wrist to axes 2 and 3, and
    turns the limits of axis 4 into bounds on theta2 + theta3. The limits leave a convex region of
    the (theta2, theta3) plane. The nearest point is therefore reached exactly, or lies on an edge
    straight towards (u, v), or in a corner. A tool point behind axis 1 is replaced by the nearest
    one on the axis.
    """
    reached = planar.at(planar.axis if planar.behind(u) > 0.0 else u, v, phi)
    if reached is not None:
        return reached
    wrist = u - planar.l3 * math.cos(phi), v - planar.l3 * math.sin(phi)
    best, minimum = None, math.inf
    for theta2, theta3 in (*_straight(planar, phi, wrist), *_corners(planar, phi)):
        posture = _inside_limits(planar, theta2, theta3, phi - theta2 - theta3)
        if posture is None:
            continue
        pu, pv = planar.tool(posture)
        gap = math.hypot(pu - u, pv - v)
        if gap < minimum and planar.behind(pu) <= tolerances.PLANAR_LIMIT_SLACK:
            best, minimum = posture, gap
    return best


def _straight(planar: PlanarArm, phi: float, wrist: tuple[float, float]) -> Iterator[_Angles]:
    """Yield the candidates on the edges: with one joint at a limit, the wrist moves on a circle."""
    l1, l2 = planar.l1, planar.l2
    on_axis = planar.axis - planar.l3 * math.cos(phi)
    for theta3 in planar.theta3.ends:
        x, y = l1 + l2 * math.cos(theta3), l2 * math.sin(theta3)
        for direction in directions((0.0, 0.0), math.hypot(x, y), wrist, on_axis):
            yield direction - math.atan2(y, x), theta3
    for theta2 in planar.theta2.ends:
        elbow = l1 * math.cos(theta2), l1 * math.sin(theta2)
        for direction in directions(elbow, l2, wrist, on_axis):
            yield theta2, direction - theta2
    for theta4 in planar.theta4.ends:
        # The forearm keeps its direction, and the wrist moves as the elbow does.
        forearm = phi - theta4
        center = l2 * math.cos(forearm), l2 * math.sin(forearm)
        for direction in directions(center, l1, wrist, on_axis):
            yield direction, forearm - direction


def _corners(planar: PlanarArm, phi: float) -> Iterator[_Angles]:
    """Yield the angles with two joints at a limit."""
    for theta2 in planar.theta2.ends:
        for theta3 in planar.theta3.ends:
            yield theta2, theta3
    for theta4 in planar.theta4.ends:
        for theta2 in planar.theta2.ends:
            yield theta2, phi - theta4 - theta2
        for theta3 in planar.theta3.ends:
            yield phi - theta4 - theta3, theta3


def _inside_limits(
    planar: PlanarArm, theta2: float, theta3: float, theta4: float
) -> Posture | None:
    """Return the posture with these angles in the turns inside the limits, or None."""
    a, b, c = planar.theta2.fit(theta2), planar.theta3.fit(theta3), planar.theta4.fit(theta4)
    if a is None or b is None or c is None:
        return None
    return Posture(a, b, c, stretched=abs(math.sin(b)) <= tolerances.LIMIT_SLACK)


class PlanarTarget(NamedTuple):
    """A target in the arm's plane.

    Attributes:
        orientation: the target orientation.
        roll: the allowed range of the roll [rad].
        roll_hint: the present roll [rad], if known.
        priority: the part of the target that is kept.
    """

    orientation: PlaneOrientation
    roll: Interval
    roll_hint: float | None
    priority: Priority


class InPlane(NamedTuple):
    """A posture of the planar arm with a roll, and the constraints that bind.

    Attributes:
        posture: the angles of axes 2 to 4.
        psi: the roll [rad].
        rotation_error: angle [rad] from the target orientation.
        posture_bound, roll_bound: True if the posture or the roll keeps the arm from the best
            orientation.
    """

    posture: Posture
    psi: float
    rotation_error: float
    posture_bound: bool
    roll_bound: bool


def reaching(planar: PlanarArm, u: float, v: float, target: PlanarTarget) -> InPlane | None:
    """Return the best solution with the tool point at (u, v), or None.

    Behind axis 1, where the branch has no points, (u, v) is replaced by the point straight across
    on the axis.
    """
    u = planar.axis if planar.behind(u) > 0.0 else u
    if target.priority is not Priority.PITCH:
        return _best_at(planar, u, v, target)
    posture = planar.at(u, v, target.orientation.best()[0])
    return None if posture is None else _with_roll(posture, target, bound=False)


def approaching(planar: PlanarArm, u: float, v: float, target: PlanarTarget) -> InPlane | None:
    """Return the solution nearest to (u, v) for a point that cannot be reached.

    None means that no posture has the pitch that is kept.
    """
    if target.priority is Priority.PITCH:
        posture = nearest_at_pitch(planar, u, v, target.orientation.best()[0])
        return None if posture is None else _with_roll(posture, target, bound=True)
    nearest = planar.nearest(u, v)
    held = _with_roll(nearest, target, bound=True)
    pu, pv = planar.tool(nearest)
    if abs(planar.behind(pu)) > tolerances.ON_AXIS:
        return held
    # On axis 1 the orientation is free to improve. At the edge of the workspace the same posture is
    # found again, with an error of the root of rounding.
    other = _best_at(planar, pu, pv, target)
    if other is None or other.rotation_error > held.rotation_error - tolerances.TOUCHING:
        return held
    return other._replace(posture_bound=True)


def _best_at(planar: PlanarArm, u: float, v: float, target: PlanarTarget) -> InPlane | None:
    """Return the best orientation with the tool point at (u, v), or None if there is no posture.

    There are three cases. Pitch and roll are both free and best; or the roll is at a limit and the
    pitch is the best for it; or a joint is at a limit and the roll is the best for that, or at its
    own limit.
    """
    wanted, roll, hint, _ = target
    phi, psi = wanted.best()
    posture = planar.at(u, v, phi)
    free_roll = roll.fit(psi)
    if posture is not None and free_roll is not None:
        return InPlane(posture, free_roll, wanted.angle(phi, psi), False, False)
    candidates: list[InPlane] = []
    for end in roll.ends:
        posture = planar.at(u, v, wanted.best_pitch(end))
        if posture is not None:
            candidates.append(InPlane(posture, end, wanted.angle(posture.phi, end), False, True))
    for posture in planar.pitch_ends(u, v):
        candidates.extend(_rolled(posture, target, bound=True))
    return _chosen(candidates, hint) if candidates else None


def _with_roll(posture: Posture, target: PlanarTarget, *, bound: bool) -> InPlane:
    """Return `posture` with the best roll, and among equal rolls the one nearest to the hint."""
    return _chosen(_rolled(posture, target, bound=bound), target.roll_hint)


def _rolled(posture: Posture, target: PlanarTarget, *, bound: bool) -> list[InPlane]:
    """Return `posture` with the roll best for its pitch, or with each end of the roll."""
    wanted, roll = target.orientation, target.roll
    best = roll.fit(wanted.best_roll(posture.phi))
    rolls = roll.ends if best is None else (best,)
    return [
        InPlane(posture, psi, wanted.angle(posture.phi, psi), bound, best is None) for psi in rolls
    ]


def _chosen(candidates: list[InPlane], roll_hint: float | None) -> InPlane:
    """Return the solution with the smallest error, and of equal ones that nearest to the hint."""
    minimum = min(candidate.rotation_error for candidate in candidates) + tolerances.SAME_ROTATION
    equal = [candidate for candidate in candidates if candidate.rotation_error <= minimum]
    return equal[0] if roll_hint is None else min(equal, key=lambda e: abs(e.psi - roll_hint))


_TURNS: Final = 100
"""Maximum number of iterations. They converge much earlier, except where the pitch of the target
changes sides with theta1.
"""


_SLOW: Final = 0.9
"""An iteration beside the roll axis that leaves this fraction of the error does not converge."""


class NearestPosture(NamedTuple):
    """The canonical angles `alpha` on `branch`, their errors, and the constraints that bind.

    Attributes:
        alpha: canonical angles [rad].
        branch: the branch of the posture.
        position_error, rotation_error: the errors [m], [rad].
        theta1_bound: True if a limit of axis 1 binds.
        in_plane: posture and roll in the arm's plane, with their constraints.
        searches: the number of searches that it took to find them.
    """

    alpha: Five
    branch: Branch
    position_error: float
    rotation_error: float
    theta1_bound: bool
    in_plane: InPlane
    searches: int = 1


def nearest_posture(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch | None, hint: Five | None
) -> NearestPosture:
    """Return the posture inside the limits of `limited` that is nearest to `canonical`.

    `branch` is the branch to stay on. None takes the nearest one, and of equal ones the one nearest
    to the angles `hint`. A target pitch that no posture has is dropped.
    """
    best = _reached(limited, canonical, branch, hint)
    if canonical.priority is Priority.PITCH:
        if canonical.along is not None and (best is None or not _exact(best)):
            best = _faced(limited, canonical, branch, hint)
        if best is None:
            canonical = canonical._replace(priority=Priority.POSITION)
            best = _reached(limited, canonical, branch, hint)
    assert best is not None
    return best


def _reached(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch | None, hint: Five | None
) -> NearestPosture | None:
    """Return the nearest posture, also for a tool point beside the roll axis, or None."""
    best = _solved(limited, canonical, branch, hint)
    if best is not None and limited.arm.off_axis > 0.0:
        return _shifted(limited, canonical, best, branch, hint)
    return best


def _faced(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch | None, hint: Five | None
) -> NearestPosture | None:
    """Return the posture with the pitch kept, with the tool facing either way, or None.

    The yaw does not count, so a roll axis with the target pitch may point away from axis 1 or
    towards it. Preferred are the directions that the roll of the target fits, whatever the yaw,
    and postures that have that roll nevertheless: a level cup stays level, the position gives way.
    """
    branches = (branch,) if branch else dict(limited.planar(None))
    postures, fitting = [], []
    for facing in (canonical.faced(inward=False), canonical.faced(inward=True)):
        fits = limited.limits[4].fit(facing.roll()) is not None
        for candidate in branches:
            posture = _reached(limited, facing, candidate, hint)
            if posture is not None:
                postures.append(posture)
                if fits or posture.rotation_error <= tolerances.SAME_ROTATION:
                    fitting.append(posture)
    return _nearest(limited, canonical, fitting or postures, hint) if postures else None


def _exact(found_posture: NearestPosture) -> bool:
    return (
        found_posture.position_error <= tolerances.SAME_POSITION
        and found_posture.rotation_error <= tolerances.SAME_ROTATION
    )


def _shifted(
    limited: LimitedArm,
    canonical: CanonicalTarget,
    best: NearestPosture,
    branch: Branch | None,
    hint: Five | None,
) -> NearestPosture:
    """Return the posture for a tool point beside the roll axis.

    `best` is the posture for the tool point taken on the axis. The two differ by the orientation
    error. The point on the axis is therefore moved by that difference and the rest is solved again,
    as long as the tool point comes nearer. The iteration ends on the target point if the arm
    reaches it. Beyond reach it ends near the nearest point, not always on it.
    """
    reached: NearestPosture | None = best
    minimum, searches = math.inf, 1
    while reached is not None and searches < _TURNS:
        tool = limited.arm.tool_point(reached.alpha)
        gap = [a - b for a, b in zip(canonical.tool, tool, strict=True)]
        error = math.hypot(*gap)
        if error >= minimum:
            break
        ended = error <= tolerances.SAME_POSITION * 1e-3 or error > _SLOW * minimum
        best, minimum = reached._replace(position_error=error), error
        if ended:
            break
        canonical = canonical.moved(*gap)
        reached = _solved(limited, canonical, branch, hint)
        searches += 1
    return best._replace(searches=searches)


def _solved(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch | None, hint: Five | None
) -> NearestPosture | None:
    """Return the best of the postures on the allowed branches, or None."""
    planar = limited.planar(branch)
    postures: list[NearestPosture] = []
    for approach in (False, True):
        for candidate, arm in planar:
            postures.extend(_nearest_postures(limited, canonical, candidate, arm, hint, approach))
        if any(
            found_posture.position_error <= tolerances.SAME_POSITION for found_posture in postures
        ):
            break
    if len(postures) <= 1:
        return postures[0] if postures else None
    return _nearest(limited, canonical, postures, hint)


def _nearest_postures(
    limited: LimitedArm,
    canonical: CanonicalTarget,
    branch: Branch,
    planar: PlanarArm,
    hint: Five | None,
    approach: bool,
) -> Iterator[NearestPosture]:
    arm, limits = limited.arm, limited.limits
    search = approaching if approach else reaching
    outward, _, up = canonical.beside
    a, d = arm.a + outward, canonical.aside(arm)
    settled = not approach or d == 0.0 or canonical.on_axis
    roll_hint = None if hint is None else hint[4]
    places: list[CanonicalTarget] = []
    for first in _theta1(limited, canonical, branch, hint):
        turn = first
        for _ in range(_TURNS):
            theta1, bound = turn
            c, s = math.cos(theta1), math.sin(theta1)
            u, v = canonical.x * c + canonical.y * s - a, up - canonical.z
            wanted = canonical.seen_from(theta1).tilted(arm.tilt)
            solution = search(
                planar, u, v, PlanarTarget(wanted, limits[4], roll_hint, canonical.priority)
            )
            if solution is None:
                break
            pu, pv = planar.tool(solution.posture)
            if settled:
                break
            # The tool point at pu is nearest to the target with theta1 turned to face it.
            turn = _fitted(limits[0], canonical.aligned(arm, pu + a))
            aligned, held = turn
            if (bound and held) or abs(aligned - theta1) <= tolerances.ALIGNED:
                bound = held
                break
        if solution is not None:
            alpha = (theta1, *solution.posture[:3], solution.psi)
            yield NearestPosture(
                alpha=alpha if hint is None else limited.turned(alpha, hint),
                branch=branch,
                position_error=math.hypot(pu - u, pv - v, canonical.y * c - canonical.x * s - d),
                rotation_error=solution.rotation_error,
                theta1_bound=bound,
                in_plane=solution,
            )
            if approach and canonical.along is not None and not canonical.on_axis:
                place = canonical._replace(x=0.0, y=0.0, z=up - pv)
                on_axis = d == 0.0 and abs(planar.behind(pu)) <= tolerances.ON_AXIS
                if on_axis and place not in places:
                    places.append(place)
    for place in places:
        # The nearest point is on axis 1, where every theta1 comes equally near.
        for posture in _nearest_postures(limited, place, branch, planar, hint, approach=False):
            yield posture._replace(
                position_error=math.hypot(canonical.x, canonical.y, canonical.z - place.z),
                in_plane=posture.in_plane._replace(posture_bound=True),
            )


def _theta1(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch, hint: Five | None
) -> Iterator[tuple[float, bool]]:
    """Yield the values of theta1 to try, each with True if a limit binds.

    Off axis 1 the direction of the point gives theta1. On the axis the plane must hold the tool's
    direction, which faces either way. With the tool along axis 1 too, theta1 is free. A roll held
    at a limit is nearest in a plane of its own.
    """
    interval = limited.limits[0]
    facing = canonical.facing(limited.arm, branch.shoulder)
    angles = (facing,) if facing is not None else _facing_on_axis(canonical, branch, hint)
    if facing is None and canonical.along is not None:
        angles += tuple(canonical.orientation.best_turn(end) for end in limited.limits[4].ends)
    for angle in angles:
        theta1, bound = _fitted(interval, angle)
        if bound and hint is not None:
            theta1 = min(interval, key=lambda end: abs(end - hint[0]))
        yield theta1, bound
        if bound and hint is None:
            # The limit farther in angle may come nearer, in position or in orientation.
            yield sum(interval) - theta1, True


def _facing_on_axis(
    canonical: CanonicalTarget, branch: Branch, hint: Five | None
) -> tuple[float, ...]:
    if canonical.along is None or math.hypot(*canonical.along[:2]) <= tolerances.ON_AXIS:
        return (0.0 if hint is None else hint[0],)
    facing = math.atan2(canonical.along[1], canonical.along[0])
    if hint is not None:
        # Both directions put the tool there: take the one with the smaller motion.
        return (min((facing, facing + math.pi), key=lambda angle: abs(wrapped(angle - hint[0]))),)
    if branch.shoulder == "back":
        return facing + math.pi, facing
    return facing, facing + math.pi


def _fitted(interval: Interval, theta: float) -> tuple[float, bool]:
    """Return `theta` if the interval holds it, else the nearer end, and True if it was moved."""
    fitted = interval.fit(theta)
    if fitted is not None:
        return fitted, False
    return min(interval, key=lambda end: abs(wrapped(end - theta))), True


def _nearest(
    limited: LimitedArm,
    canonical: CanonicalTarget,
    postures: list[NearestPosture],
    hint: Five | None,
) -> NearestPosture:
    """Return the posture with the smallest errors, in the order of the priority."""
    postures = _minimum(
        postures,
        [found_posture.position_error for found_posture in postures],
        tolerances.SAME_POSITION,
    )
    if canonical.priority is Priority.POSITION:
        pitch = [limited.arm.pitch(s.alpha) - canonical.pitch(s.alpha[0]) for s in postures]
        postures = _minimum(
            postures, [abs(wrapped(error)) for error in pitch], tolerances.SAME_ROTATION
        )
    postures = _minimum(
        postures,
        [found_posture.rotation_error for found_posture in postures],
        tolerances.SAME_ROTATION,
    )
    if hint is None:
        return postures[0]
    return min(postures, key=lambda s: max(abs(a - b) for a, b in zip(hint, s.alpha, strict=True)))


def _minimum(
    postures: list[NearestPosture], errors: list[float], same: float
) -> list[NearestPosture]:
    """Return the postures whose error is the smallest, to within `same`."""
    minimum = min(errors) + same
    return [
        found_posture
        for found_posture, error in zip(postures, errors, strict=True)
        if error <= minimum
    ]
