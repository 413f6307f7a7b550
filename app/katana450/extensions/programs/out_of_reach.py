"""Message about a place that the tool cannot reach: by how much, what binds, and what works."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.messages import axis_names
from katana450.extensions.programs.fields import XYZ
from katana450.extensions.programs.reaching import EXACT, branches_near, reaching
from katana450.extensions.programs.script_frame import ScriptFrame
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import leap
from katana450.tolerances import LIMIT_SLACK

STEP = 0.1
"""[mm] and [deg] Resolution of the suggested places."""

WIDER = math.radians(5.0)
"""[rad] Angle by which a limit is widened to find out whether it binds."""


@dataclass(frozen=True, eq=False)
class NearestPlace:
    """The nearest place that the tool can take instead of a target.

    Attributes:
        pose: the place, with pitch and roll as the target has them.
        projection: its posture, its errors, and what keeps the arm from coming nearer.
        target: the target as it is for the shoulder of this posture.
        priority: which part of the target is kept.
    """

    pose: ToolTarget
    projection: Projection
    target: ToolTarget
    priority: Priority

    @property
    def errors(self) -> tuple[float, float, float]:
        """The errors [m or rad] in the order of the priority, without differences by rounding."""
        best = self.projection
        position, pitch = round(best.position_error, 9), round(best.pitch_error, 9)
        first, second = (pitch, position) if self.priority is Priority.PITCH else (position, pitch)
        return first, second, round(best.roll_error, 9)


def nearest_place(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch | None, priority: Priority
) -> NearestPlace:
    """Return the nearest place to ``target``.

    Args:
        chain: the arm with its tool.
        q: (5,) present joint angles [rad].
        target: pose of the tool, in {S}.
        branch: the only branch that may be used; None for all.
        priority: PITCH for the nearest position with this pitch, POSITION for the nearest pitch.
    """
    here, found = branch_of(chain, q), []
    for tried in branches_near(chain, q) if branch is None else (branch,):
        turned = branch is None and tried.shoulder != here.shoulder
        wanted = target.turned_round() if turned else target
        best = leap(chain, q, wanted, tried, priority)
        pose = ToolTarget.at(chain, best.q)
        found.append(NearestPlace(pose.turned_round() if turned else pose, best, wanted, priority))
    return min(found, key=lambda each: each.errors)


def out_of_reach(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch | None
) -> NearestPlace:
    """Return the nearest place with the pitch of ``target``, or at it if only the roll is missed.

    Arguments as for ``nearest_place``.
    """
    there = nearest_place(chain, q, target, branch, Priority.POSITION)
    if there.errors[:2] == (0.0, 0.0):
        return there
    return nearest_place(chain, q, target, branch, Priority.PITCH)


def unreached(
    chain: Chain,
    q: FloatArray,
    target: ToolTarget,
    branch: Branch | None,
    tool: str,
    frame: ScriptFrame,
) -> str:
    """Return why the tool cannot be at ``target``, by how much, and what it can reach instead.

    Args:
        chain: the arm with its tool.
        q: (5,) present joint angles [rad].
        target: pose of the tool, in {S}.
        branch: the only branch that may be used; None for all.
        tool: name of the tool frame.
        frame: the frame of the script.
    """
    why = (
        f"The tool {tool} cannot be at {frame.words(target.position)} with a "
        f"pitch of {np.degrees(target.pitch):.1f} deg"
    )
    if frame.looks_like_metres(target.position):
        return f"{why}. Lengths are in mm here; a length in metres has its unit, as in `0.3 m`."
    moved = out_of_reach(chain, q, target, branch)
    works = list(_works(chain, q, target, branch, frame, moved))
    remedy = f" It can be {' or '.join(works)}." if works else ""
    return f"{why}: {_amount(moved.projection)}, because {binding(chain, moved)}.{remedy}"


def binding(chain: Chain, nearest: NearestPlace) -> str:
    """Return in words what keeps the tool from coming nearer than ``nearest``."""
    best, found = nearest.projection, []
    for axis in _binding_axes(chain, nearest):
        angle, lower, upper = best.q[axis], chain.lower[axis], chain.upper[axis]
        limit = math.degrees(lower if angle - lower < upper - angle else upper)
        name = axis_names(chain.names)[axis]
        found.append(f"axis {axis + 1}, {name}, is at its limit of {round(limit, 2):g} deg")
    if best.axis1:
        found.append("axis 1 is in the way")
    if not found or best.reach:
        found.append(_links(chain, best.q))
    return " and ".join(found)


def _binding_axes(chain: Chain, nearest: NearestPlace) -> tuple[int, ...]:
    """Return the axes (from 0) at a limit without which the tool would come nearer."""
    best = nearest.projection

    def binds(axis: int) -> bool:
        wider = np.zeros(len(chain.names))
        wider[axis] = WIDER
        freed = replace(chain, lower=chain.lower - wider, upper=chain.upper + wider)
        assert isinstance(best.branch, Branch)
        found = leap(freed, best.q, nearest.target, best.branch, nearest.priority)
        return replace(nearest, projection=found).errors < nearest.errors

    # At a corner of the limits, none alone may help.
    return tuple(axis for axis in best.limits if binds(axis)) or best.limits


def millimetres(length: float) -> str:
    """Return a length [m] in mm: with one decimal from 1 mm, with two digits below."""
    shown = 1e3 * length
    return f"{shown:.1f} mm" if shown >= 1.0 else f"{shown:.2g} mm"


def near(value: float) -> Iterator[float]:
    """Yield the multiples of STEP beside ``value``, the nearer one first."""
    low, high = math.floor(value / STEP), math.ceil(value / STEP)
    for each in sorted({low, high}, key=lambda n: abs(n * STEP - value)):
        yield round(each * STEP, 6)


def near_points(frame: ScriptFrame, p: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Yield points near ``p`` (3,) [m] in {S}, whose numbers are short: as text, and in {S} [m]."""
    for point in itertools.product(*(near(each) for each in frame.shown(p).tolist())):
        place = ", ".join(f"{name}: {each:g}" for name, each in zip(XYZ, point, strict=True))
        yield f"{{{place}}}", frame.point(np.array(point))


def _amount(nearest: Projection) -> str:
    """Return by how much the target is missed, in words."""
    if nearest.pitch_error > EXACT:
        return (
            f"this pitch is {math.degrees(nearest.pitch_error):.1f} deg beyond what the arm can "
            "have"
        )
    if nearest.position_error > EXACT:
        return f"it is {millimetres(nearest.position_error)} out of reach"
    return f"the roll is {math.degrees(nearest.roll_error):.1f} deg beyond what the arm can have"


def _links(chain: Chain, q: FloatArray) -> str:
    """Return how the links keep the tool from coming nearer."""
    # The canonical arm is stretched where its third angle is 0.
    elbow = math.remainder(arm_of(chain).angles(q)[2], math.tau)
    return "the arm is stretched" if abs(elbow) <= LIMIT_SLACK else "its links reach no farther"


def _works(
    chain: Chain,
    q: FloatArray,
    target: ToolTarget,
    branch: Branch | None,
    frame: ScriptFrame,
    moved: NearestPlace,
) -> Iterator[str]:
    """Yield texts to copy, each of which makes ``target`` reachable."""

    def reached(pose: ToolTarget) -> bool:
        return reaching(chain, q, pose, branch) is not None

    turned = nearest_place(chain, q, target, branch, Priority.POSITION)
    for pitch in near(math.degrees(turned.pose.pitch)):
        if reached(replace(target, pitch=math.radians(pitch))):
            yield f"with `pitch: {pitch:g}`"
            break
    for roll in near(math.degrees(moved.pose.roll)) if moved.projection.roll_error > EXACT else ():
        if reached(replace(target, roll=math.radians(roll))):
            yield f"with `roll: {roll:g}`"
            break
    for text, p in near_points(frame, moved.pose.position):
        if reached(replace(target, position=p)):
            yield f"at `{text}` with this pitch"
            break
