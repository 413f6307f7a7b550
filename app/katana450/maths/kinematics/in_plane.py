"""The arm in its plane with theta1 set: a posture of axes 2 to 4, and a roll."""

from __future__ import annotations

from typing import NamedTuple

from katana450 import tolerances
from katana450.maths.kinematics.level import nearest_at_pitch
from katana450.maths.kinematics.orientation import PlaneOrientation
from katana450.maths.kinematics.planar import Interval, PlanarArm, Posture
from katana450.maths.kinematics.priority import Priority


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
    found: list[InPlane] = []
    for end in roll.ends:
        posture = planar.at(u, v, wanted.best_pitch(end))
        if posture is not None:
            found.append(InPlane(posture, end, wanted.angle(posture.phi, end), False, True))
    for posture in planar.pitch_ends(u, v):
        found.extend(_rolled(posture, target, bound=True))
    return _chosen(found, hint) if found else None


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


def _chosen(found: list[InPlane], roll_hint: float | None) -> InPlane:
    """Return the solution with the smallest error, and of equal ones that nearest to the hint."""
    minimum = min(each.rotation_error for each in found) + tolerances.SAME_ROTATION
    equal = [each for each in found if each.rotation_error <= minimum]
    return equal[0] if roll_hint is None else min(equal, key=lambda e: abs(e.psi - roll_hint))
