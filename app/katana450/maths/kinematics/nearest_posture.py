"""How the arm stands nearest to what is asked: position first, then the orientation.

In closed form on the canonical arm: with theta1 set, the problem is planar, its optimum is either
free of every limit or has a joint on one, and each such case is a meeting of two circles. Only
where the plane passes beside axis 1 and the point is out of reach do theta1 and the posture depend
on each other; they are then found in turns. Lengths in m, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

from katana450 import tolerances
from katana450.maths.kinematics.arm import Five
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.in_plane import InPlane, PlanarTarget, approaching, reaching
from katana450.maths.kinematics.limited import LimitedArm
from katana450.maths.kinematics.planar import Interval, PlanarArm
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.turns import wrapped

_TURNS: Final = 100
"""Most steps of the iterations that end by themselves, each step much nearer than the last: all but
those where the pitch asked for changes sides with theta1."""


_SLOW: Final = 0.9
"""A step beside the roll axis that leaves so much of the error is on its way to no solution."""


class NearestPosture(NamedTuple):
    """The canonical angles `alpha` on `branch`, what they miss, and what holds them there.

    searches: how many it took to find them.
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
    """That inside the limits of `limited` which is nearest to `asked`.

    branch: the one to stay on; None takes the one that comes nearest, and of equals the one nearest
    to the angles `hint`. A pitch that is held and that no posture has is not held.
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
    best = _solved(limited, canonical, branch, hint)
    if best is not None and limited.arm.off_axis > 0.0:
        return _shifted(limited, canonical, best, branch, hint)
    return best


def _faced(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch | None, hint: Five | None
) -> NearestPosture | None:
    """The stance with the pitch kept, whichever way round the tool faces; None if there is none.

    The yaw does not count, so a roll axis with the asked pitch may point away from axis 1 or
    towards it. The way that keeps the roll is preferred, since the position is to give way.
    """
    branches = (branch,) if branch else dict(limited.planar(None))
    ways = canonical.faced(inward=False), canonical.faced(inward=True)
    tried = (_reached(limited, way, each, hint) for each in branches for way in ways)
    found = [found_posture for found_posture in tried if found_posture is not None]
    kept = [
        found_posture
        for found_posture in found
        if found_posture.rotation_error <= tolerances.SAME_ROTATION
    ]
    return _nearest(limited, canonical, kept or found, hint) if found else None


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
    """The stance with a tool point beside the roll axis, from that with the point on the axis.

    The two part by what the orientation misses, so the point on the axis is moved by that and the
    rest solved again, as long as the tool point comes nearer. It ends on the asked point where the
    arm reaches it; beyond reach it ends near the nearest one, not always on it.
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
    planar = limited.planar(branch)
    found: list[NearestPosture] = []
    for approach in (False, True):
        for each, arm in planar:
            found.extend(_nearest_postures(limited, canonical, each, arm, hint, approach))
        if any(found_posture.position_error <= tolerances.SAME_POSITION for found_posture in found):
            break
    if len(found) <= 1:
        return found[0] if found else None
    return _nearest(limited, canonical, found, hint)


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
    for first in _theta1(limited, canonical, branch, hint):
        turn = first
        for _ in range(_TURNS):
            theta1, bound = turn
            c, s = math.cos(theta1), math.sin(theta1)
            u, v = canonical.x * c + canonical.y * s - a, up - canonical.z
            wanted = canonical.seen_from(theta1).tilted(arm.tilt)
            found = search(
                planar, u, v, PlanarTarget(wanted, limits[4], roll_hint, canonical.priority)
            )
            if found is None:
                break
            pu, pv = planar.tool(found.posture)
            if settled:
                break
            # The tool point at pu is nearest to the asked one with theta1 turned to face it so.
            turn = _fitted(limits[0], canonical.aligned(arm, pu + a))
            aligned, held = turn
            if (bound and held) or abs(aligned - theta1) <= tolerances.ALIGNED:
                bound = held
                break
        if found is not None:
            alpha = (theta1, *found.posture[:3], found.psi)
            yield NearestPosture(
                alpha=alpha if hint is None else limited.turned(alpha, hint),
                branch=branch,
                position_error=math.hypot(pu - u, pv - v, canonical.y * c - canonical.x * s - d),
                rotation_error=found.rotation_error,
                theta1_bound=bound,
                in_plane=found,
            )


def _theta1(
    limited: LimitedArm, canonical: CanonicalTarget, branch: Branch, hint: Five | None
) -> Iterator[tuple[float, bool]]:
    """The theta1 to try, and whether a limit holds it there.

    Off axis 1 the point's direction gives it. On it the plane must hold the tool's direction, which
    faces either way; with the tool along axis 1 too, nothing is asked of theta1. A roll held at an
    end is nearest in a plane of its own.
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
        if bound and hint is None and canonical.aside(limited.arm) != 0.0:
            # Beside axis 1 the end farther in angle may come nearer.
            yield sum(interval) - theta1, True


def _facing_on_axis(
    canonical: CanonicalTarget, branch: Branch, hint: Five | None
) -> tuple[float, ...]:
    if canonical.along is None or math.hypot(*canonical.along[:2]) <= tolerances.ON_AXIS:
        return (0.0 if hint is None else hint[0],)
    facing = math.atan2(canonical.along[1], canonical.along[0])
    if hint is not None:
        # Both ways put the tool there; turning round would be a motion nobody asked for.
        return (min((facing, facing + math.pi), key=lambda angle: abs(wrapped(angle - hint[0]))),)
    if branch.shoulder == "back":
        return facing + math.pi, facing
    return facing, facing + math.pi


def _fitted(interval: Interval, theta: float) -> tuple[float, bool]:
    """`theta` if the interval holds it, else its nearer end, and whether it had to be."""
    fitted = interval.fit(theta)
    if fitted is not None:
        return fitted, False
    return min(interval, key=lambda end: abs(wrapped(end - theta))), True


def _nearest(
    limited: LimitedArm, canonical: CanonicalTarget, found: list[NearestPosture], hint: Five | None
) -> NearestPosture:
    found = _minimum(
        found, [found_posture.position_error for found_posture in found], tolerances.SAME_POSITION
    )
    if canonical.priority is Priority.POSITION:
        pitch = [limited.arm.pitch(s.alpha) - canonical.pitch(s.alpha[0]) for s in found]
        found = _minimum(found, [abs(wrapped(error)) for error in pitch], tolerances.SAME_ROTATION)
    found = _minimum(
        found, [found_posture.rotation_error for found_posture in found], tolerances.SAME_ROTATION
    )
    if hint is None:
        return found[0]
    return min(found, key=lambda s: max(abs(a - b) for a, b in zip(hint, s.alpha, strict=True)))


def _minimum(found: list[NearestPosture], errors: list[float], same: float) -> list[NearestPosture]:
    minimum = min(errors) + same
    return [
        found_posture
        for found_posture, error in zip(found, errors, strict=True)
        if error <= minimum
    ]
