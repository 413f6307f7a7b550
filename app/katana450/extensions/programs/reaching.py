"""Joint angles for a pose of the tool, or a message with the nearest poses that it can reach."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from katana450.extensions.programs.fields import XYZ
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import leap

EXACT = 1e-9
"""[m] and [rad] Maximum error of a place that counts as reached."""

METRES = 2.0
"""[mm] Coordinates that are all smaller look like metres."""

STEP = 0.1
"""[mm] and [deg] Resolution of the suggested places."""


def branches_near(chain: Chain, q: FloatArray) -> tuple[Branch, ...]:
    """Return all branches, that of ``q`` (5,) [rad] first, then the one that is nearest to it."""
    here = branch_of(chain, q)
    near = sorted(BRANCHES, key=lambda each: (each.shoulder != here.shoulder, each != here))
    return tuple(near)


def reaching(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch | None
) -> FloatArray | None:
    """Return the joint angles (5,) [rad] for ``target``; None if it is out of reach.

    Args:
        chain: the arm with its tool.
        q: (5,) present joint angles [rad].
        target: pose of the tool, in {S}.
        branch: the only branch that may be used; None for all, the present one first.
    """
    here = branch_of(chain, q)
    for tried in branches_near(chain, q) if branch is None else (branch,):
        # With the other shoulder posture the same tool pose has other pitch and roll values.
        turned = branch is None and tried.shoulder != here.shoulder
        pose = target.turned_round() if turned else target
        found = leap(chain, q, pose, tried, Priority.POSE)
        if max(found.position_error, found.rotation_error) <= EXACT:
            return found.q
    return None


def unreached(
    chain: Chain,
    q: FloatArray,
    target: ToolTarget,
    branch: Branch | None,
    tool: str,
    T_base_shoulder: FloatArray | None,
) -> str:
    """Return why the tool cannot be at ``target``, and what it can reach instead.

    Args:
        chain: the arm with its tool.
        q: (5,) present joint angles [rad].
        target: pose of the tool, in {S}.
        branch: the only branch that may be used; None for all.
        tool: name of the tool frame.
        T_base_shoulder: (4, 4) pose of {S} if the script's points are in the base frame.
    """
    T = np.eye(4) if T_base_shoulder is None else T_base_shoulder
    frame = "shoulder" if T_base_shoulder is None else "base"

    def shown(p: FloatArray) -> FloatArray:
        """Return the point [m] of {S} in the frame of the script [mm]."""
        return 1e3 * (T[:3, :3] @ p + T[:3, 3])

    def reached(pose: ToolTarget) -> bool:
        return reaching(chain, q, pose, branch) is not None

    def nearest(priority: Priority, error: Callable[[ToolTarget], float]) -> ToolTarget:
        branches = branches_near(chain, q) if branch is None else (branch,)
        found = (leap(chain, q, target, each, priority) for each in branches)
        return min((ToolTarget.at(chain, each.q) for each in found), key=error)

    turned = nearest(Priority.POSITION, lambda pose: abs(pose.pitch - target.pitch))
    moved = nearest(
        Priority.PITCH, lambda pose: float(np.linalg.norm(pose.position - target.position))
    )
    works = []
    for pitch in _near(math.degrees(turned.pitch)):
        if reached(replace(target, pitch=math.radians(pitch))):
            works.append(f"with `pitch: {pitch:g}`")
            break
    back = se3.inverse(T)
    for point in itertools.product(*(_near(each) for each in shown(moved.position).tolist())):
        p = back[:3, :3] @ (1e-3 * np.array(point)) + back[:3, 3]
        if reached(replace(target, position=p)):
            place = ", ".join(f"{name}: {each:g}" for name, each in zip(XYZ, point, strict=True))
            works.append(f"at `{{{place}}}` with this pitch")
            break
    x, y, z = shown(target.position).tolist()
    why = (
        f"The tool {tool} cannot be at ({x:.1f}, {y:.1f}, {z:.1f}) mm in the {frame} frame with a "
        f"pitch of {np.degrees(target.pitch):.1f} deg"
    )
    if max(abs(x), abs(y), abs(z)) < METRES:
        return f"{why}. Lengths are in mm here; a length in metres has its unit, as in `0.3 m`."
    off = 1e3 * float(np.linalg.norm(moved.position - target.position))
    if not works:
        return f"{why}: with this pitch the nearest point is {off:.3g} mm away."
    return f"{why}. It can be {' or '.join(works)}."


def _near(value: float) -> Iterator[float]:
    """Yield the multiples of STEP beside ``value``, the nearer one first."""
    low, high = math.floor(value / STEP), math.ceil(value / STEP)
    for each in sorted({low, high}, key=lambda n: abs(n * STEP - value)):
        yield round(each * STEP, 6)
