"""Messages about places out of reach: by how much, what binds, and the nearest place."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from katana450.arm.control.state.messages import axis_names, joint_unit
from katana450.extensions.programs.language.kinds import XYZ
from katana450.extensions.programs.language.scope import ScriptFrame
from katana450.extensions.programs.planning.tool_planning import EXACT, ToolPlanning
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
)
from katana450.maths.kinematics.tool import ToolTarget
from katana450.tolerances import LIMIT_SLACK

STEP = 0.1
"""[mm] and [deg] Resolution of the suggested places."""

WIDER = math.radians(5.0)
"""[rad] Angle by which a limit is widened to find out whether it binds."""

CLEAR_TURN = math.radians(1.0)
"""[rad] Error of the orientation that is reported beside one of the position."""


@dataclass(frozen=True, eq=False)
class NearestPlace:
    """The nearest place that the tool can take instead of a target.

    Attributes:
        pose: the place, in the numbers of the target.
        projection: its posture, its errors, and what keeps the arm from coming nearer.
        branch: the branch on which it was searched.
        target: the target in the numbers of this branch.
        priority: which part of the target is kept.
    """

    pose: ToolTarget
    projection: Projection
    branch: AnyBranch
    target: ToolTarget
    priority: Priority

    @property
    def errors(self) -> tuple[float, float, float]:
        """The errors [m or rad] in the order of the priority, without differences by rounding."""
        best = self.projection
        position, roll = round(best.position_error, 9), round(best.roll_error, 9)
        turn = round(best.rotation_error, 6)
        if self.target.is_pitched:
            turn = round(best.pitch_error, 9)
        if self.priority in (Priority.PITCH, Priority.ORIENTATION):
            return turn, position, roll
        return position, turn, roll


def nearest_place(
    planning: ToolPlanning,
    q: FloatArray,
    target: ToolTarget,
    branch: AnyBranch | None,
    priority: Priority,
) -> NearestPlace:
    """Return the nearest place to ``target``.

    Args:
        planning: that of the tool.
        q: (n,) present joint angles [rad].
        target: of the tool.
        branch: the only branch that may be used; None for all.
        priority: one of ``planning.priorities``.
    """
    present, places = planning.kinematics.branch_of(q), []
    for other, wanted in planning.seen_from(q, target, branch):
        best = planning.nearest(q, wanted, other, priority)
        pose = planning.at(best.q)
        if branch is None:
            pose = planning.converted(pose, other, present)
        places.append(NearestPlace(pose, best, other, wanted, priority))
    return min(places, key=lambda place: place.errors)


def unreached(
    planning: ToolPlanning,
    q: FloatArray,
    target: ToolTarget,
    branch: AnyBranch | None,
    frame: ScriptFrame,
) -> str:
    """Return why the tool cannot be at ``target``, by how much, and what it can reach instead.

    Arguments as for `nearest_place`; ``frame``: the frame of the script.
    """
    orientation = planning.orientation
    if target.is_pitched:
        orientation = f"a pitch of {np.degrees(target.pitch):.1f} deg"
    where = frame.words(target.position)
    why = f"The tool {planning.state.tool} cannot be at {where} with {orientation}"
    if frame.looks_like_metres(target.position):
        return f"{why}. Lengths are in mm here; a length in metres has its unit, as in `0.3 m`."
    positioned, oriented = (
        nearest_place(planning, q, target, branch, priority) for priority in planning.priorities
    )
    # Only the roll may be missed.
    moved = positioned if positioned.errors[:2] == (0.0, 0.0) else oriented
    remedy = ""
    for text, place in near_places(frame, target, moved.pose):
        if planning.joints(q, place, branch) is not None:
            is_turned = (place.pitch, place.roll) != (target.pitch, target.roll)
            orientation = "" if is_turned else f" with {planning.orientation}"
            remedy = f" It can be at `{text}`{orientation}."
            break
    missed = _missed(moved)
    if not missed:
        # The nearest posture takes it, but on another branch.
        return f"{why}: it is reached on the branch {moved.projection.branch} only.{remedy}"
    return f"{why}: {missed}, because {binding(planning, moved)}.{remedy}"


def binding(planning: ToolPlanning, nearest: NearestPlace) -> str:
    """Return in words what keeps the tool from coming nearer than ``nearest``."""
    best, chain, causes = nearest.projection, planning.chain, []
    for axis in _binding_axes(planning, nearest):
        angle, lower, upper = best.q[axis], chain.lower[axis], chain.upper[axis]
        factor, unit = joint_unit(slides=chain.slides[axis])
        limit = factor * (lower if angle - lower < upper - angle else upper)
        name = axis_names(chain.names)[axis]
        causes.append(f"axis {axis + 1}, {name}, is at its limit of {round(limit, 2):g} {unit}")
    if best.axis1:
        causes.append("axis 1 is in the way")
    if not causes or best.reach:
        causes.append(_links(planning, best.q))
    return "; ".join(causes)


def _binding_axes(planning: ToolPlanning, nearest: NearestPlace) -> tuple[int, ...]:
    """Return the axes (from 0) at a limit without which the tool would come nearer."""
    best, chain = nearest.projection, planning.chain

    def binds(axis: int) -> bool:
        wider = np.zeros(chain.n)
        wider[axis] = WIDER
        freed = replace(chain, lower=chain.lower - wider, upper=chain.upper + wider)
        kinematics: Any = planning.kinematics
        other = replace(planning, kinematics=replace(kinematics, chain=freed))
        projection = other.nearest(best.q, nearest.target, nearest.branch, nearest.priority)
        return replace(nearest, projection=projection).errors < nearest.errors

    # At a corner of the limits, none alone may help.
    return tuple(axis for axis in best.limits if binds(axis)) or best.limits


def millimetres(length: float) -> str:
    """Return a length [m] in mm: with one decimal from 1 mm, with two digits below."""
    shown = 1e3 * length
    return f"{shown:.1f} mm" if shown >= 1.0 else f"{shown:.2g} mm"


def near(value: float) -> Iterator[float]:
    """Yield the multiples of STEP beside ``value``, the nearer one first."""
    low, high = math.floor(value / STEP), math.ceil(value / STEP)
    for multiple in sorted({low, high}, key=lambda n: abs(n * STEP - value)):
        yield round(multiple * STEP, 6)


def near_places(
    frame: ScriptFrame, target: ToolTarget, pose: ToolTarget
) -> Iterator[tuple[str, ToolTarget]]:
    """Yield places near ``pose`` whose numbers are short: as text of a script, and as target.

    The orientation is that of ``target``, except for a pitch and a roll in which ``pose`` differs.
    """
    names = [
        name
        for name in ("pitch", "roll")
        if target.is_pitched and abs(getattr(pose, name) - getattr(target, name)) > EXACT
    ]
    angles = [math.degrees(getattr(pose, name)) for name in names]
    for numbers in itertools.product(*map(near, (*frame.shown(pose.position).tolist(), *angles))):
        fields = zip((*XYZ, *names), numbers, strict=True)
        text = ", ".join(f"{name}: {number:g}" for name, number in fields)
        turned = dict(zip(names, np.radians(numbers[3:]).tolist(), strict=True))
        place = target.moved(frozen(frame.point(np.array(numbers[:3]))))
        yield f"{{{text}}}", replace(place, **turned)


def _missed(nearest: NearestPlace) -> str:
    """Return by how much the target is missed, in words; "" if it is not."""
    best, missed = nearest.projection, []
    if best.pitch_error > EXACT:
        return (
            f"this pitch is {math.degrees(best.pitch_error):.1f} deg beyond what the arm can have"
        )
    # A posture by search is less exact.
    smallest = EXACT if nearest.target.is_pitched else POSITION_WORTH_TELLING
    if best.position_error > smallest:
        missed.append(f"it is {millimetres(best.position_error)} out of reach")
    if nearest.target.is_pitched:
        roll = f"the roll is {math.degrees(best.roll_error):.1f} deg beyond what the arm can have"
        return "".join(missed) or roll
    if best.rotation_error > (CLEAR_TURN if missed else ANGLE_WORTH_TELLING):
        missed.append(f"its orientation is {math.degrees(best.rotation_error):.3g} deg off")
    return "; ".join(missed)


def _links(planning: ToolPlanning, q: FloatArray) -> str:
    """Return how the links keep the tool from coming nearer."""
    if planning.is_pitched:
        # The canonical arm is stretched where its third angle is 0.
        elbow = math.remainder(arm_of(planning.chain).angles(q)[2], math.tau)
        if abs(elbow) <= LIMIT_SLACK:
            return "the arm is stretched"
    return "its links reach no farther"
