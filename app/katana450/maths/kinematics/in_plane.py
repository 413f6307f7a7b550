"""The arm in its plane with theta1 set: a posture of axes 2 to 4, and a roll."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from katana450 import tolerances
from katana450.maths.kinematics.canonical_target import PlaneOrientation
from katana450.maths.kinematics.planar import Interval, PlanarArm, Posture
from katana450.maths.kinematics.priority import Priority

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
        posture = _fitted(planar, theta2, theta3, phi - theta2 - theta3)
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
        for direction in _directions((0.0, 0.0), math.hypot(x, y), wrist, on_axis):
            yield direction - math.atan2(y, x), theta3
    for theta2 in planar.theta2.ends:
        elbow = l1 * math.cos(theta2), l1 * math.sin(theta2)
        for direction in _directions(elbow, l2, wrist, on_axis):
            yield theta2, direction - theta2
    for theta4 in planar.theta4.ends:
        # The forearm keeps its direction, and the wrist moves as the elbow does.
        forearm = phi - theta4
        center = l2 * math.cos(forearm), l2 * math.sin(forearm)
        for direction in _directions(center, l1, wrist, on_axis):
            yield direction, forearm - direction


def _directions(
    center: tuple[float, float], radius: float, wrist: tuple[float, float], on_axis: float
) -> Iterator[float]:
    """Yield the direction from `center` to the target wrist, and those with the tool on axis 1."""
    yield math.atan2(wrist[1] - center[1], wrist[0] - center[0])
    along = on_axis - center[0]
    if abs(along) <= radius:
        across = math.sqrt((radius - along) * (radius + along))
        yield math.atan2(across, along)
        yield math.atan2(-across, along)


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


def _fitted(planar: PlanarArm, theta2: float, theta3: float, theta4: float) -> Posture | None:
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
