"""Messages about poses that a tool outside the five-axis family cannot reach."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from katana450.arm.control.messages import axis_names
from katana450.arm.control.state import State
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.out_of_reach import millimetres, near_points
from katana450.extensions.programs.pose_curve import PoseCurve
from katana450.extensions.programs.script_frame import ScriptFrame
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
)
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.jet import Jet

SAMPLES: Final = 17
"""Number of places of a path that are compared."""

WORTH_TELLING_TOO: Final = math.radians(1.0)
"""[rad] Error of the orientation that is reported beside one of the position."""

Reached = Callable[[ToolPose], bool]
"""Returns whether the tool can take a pose."""


def nearest(
    kinematics: DrivenTool,
    state: State,
    q: FloatArray,
    target: ToolPose,
    branch: AnyBranch,
    priority: Priority = Priority.POSE,
) -> Projection:
    """Return the posture on ``branch`` nearest to ``target``, with the arm at `q` (n,) [rad]."""
    here = replace(state, goal=q, branch=kinematics.branch_of(q), priority=priority)
    return kinematics.leap(here, target, branch)


def unreached(
    kinematics: DrivenTool,
    state: State,
    q: FloatArray,
    target: ToolPose,
    branches: Sequence[AnyBranch],
    frame: ScriptFrame,
    reached: Reached,
) -> str:
    """Return why the tool cannot be at ``target``, by how much, and what it can reach instead.

    Args:
        kinematics: the arm with its tool.
        state: its state.
        q: (n,) present joint angles [rad].
        target: pose of the tool.
        branches: the branches that may be used.
        frame: the frame of the script.
        reached: see `Reached`.
    """
    why = f"The tool {state.tool} cannot be at {frame.words(target.position)} with this orientation"
    if frame.looks_like_metres(target.position):
        return f"{why}. Lengths are in mm here; a length in metres has its unit, as in `0.3 m`."
    found = [nearest(kinematics, state, q, target, each, Priority.ORIENTATION) for each in branches]
    best = min(found, key=lambda each: (round(each.rotation_error, 6), each.position_error))
    turned = [nearest(kinematics, state, q, target, each, Priority.POSE) for each in branches]
    there = min(turned, key=lambda each: (round(each.position_error, 6), each.rotation_error))
    works = [*_places(best, target, frame, reached), *_turns(there, target, frame, reached)]
    remedy = f" It can be {' or '.join(works)}." if works else ""
    return f"{why}: {amount(kinematics, best)}.{remedy}"


def amount(kinematics: DrivenTool, best: Projection) -> str:
    """Return by how much ``best`` misses its target, and why, as a clause."""
    missed = []
    if best.position_error > POSITION_WORTH_TELLING:
        missed.append(f"it is {millimetres(best.position_error)} out of reach")
    if best.rotation_error > (WORTH_TELLING_TOO if missed else ANGLE_WORTH_TELLING):
        missed.append(f"its orientation is {math.degrees(best.rotation_error):.3g} deg off")
    if not missed:
        # The nearest posture takes it, but on another branch.
        return f"it is reached on the branch {best.branch} only"
    chain, binding = kinematics.chain, []
    for axis in best.limits:
        angle, lower, upper = best.q[axis], chain.lower[axis], chain.upper[axis]
        limit = math.degrees(lower if angle - lower < upper - angle else upper)
        name = axis_names(chain.names)[axis]
        binding.append(f"axis {axis + 1}, {name}, is at its limit of {round(limit, 2):g} deg")
    why = " and ".join(binding) or "its links reach no farther"
    return f"{' and '.join(missed)}, because {why}"


def farthest(
    kinematics: DrivenTool,
    state: State,
    q: FloatArray,
    curve: PoseCurve,
    branch: AnyBranch,
    frame: ScriptFrame,
) -> str:
    """Return a sentence on the place of ``curve`` that is farthest out of reach, or ""."""
    worst: tuple[float, float, ToolPose, Projection] | None = None
    for sigma in np.linspace(0.0, 1.0, SAMPLES).tolist():
        checkpoint()
        target = ToolPose.of(curve.at(Jet.variable(sigma)).T[0])
        best = nearest(kinematics, state, q, target, branch, Priority.ORIENTATION)
        missed = best.position_error
        if missed > POSITION_WORTH_TELLING and (worst is None or missed > worst[0]):
            worst = missed, sigma, target, best
    if worst is None:
        return ""
    _, sigma, target, best = worst
    return (
        f" Farthest out of reach is {frame.words(target.position)}, {100.0 * sigma:.0f} % along "
        f"it: {amount(kinematics, best)}."
    )


def _places(
    best: Projection, target: ToolPose, frame: ScriptFrame, reached: Reached
) -> Iterator[str]:
    """Yield a text with a place near the target that the tool reaches with this orientation."""
    for text, p in near_points(frame, best.T[:3, 3]):
        if reached(target.moved(frozen(p))):
            yield f"at `{text}` with this orientation"
            return


def _turns(
    best: Projection, target: ToolPose, frame: ScriptFrame, reached: Reached
) -> Iterator[str]:
    """Yield a text with an orientation that the tool of six or more axes can have there."""
    if len(best.q) < 6 or best.position_error > POSITION_WORTH_TELLING:
        return
    R = frame.T[:3, :3]
    roll, pitch, yaw = np.round(np.degrees(so3.to_rpy(R @ best.T[:3, :3])), 1) + 0.0
    turned = R.T @ so3.from_rpy(*np.radians((roll, pitch, yaw)))
    if reached(replace(target, R=frozen(turned))):
        yield f"with `roll: {roll:g}, pitch: {pitch:g}, yaw: {yaw:g}`"
