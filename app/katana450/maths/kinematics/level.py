"""The planar arm at a fixed pitch: the posture whose tool point is nearest to a target point."""

from __future__ import annotations

import math
from collections.abc import Iterator

from katana450 import tolerances
from katana450.maths.kinematics.planar import PlanarArm, Posture

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
