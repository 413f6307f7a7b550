"""The exact member of the family nearest to a chain from a file with rounded numbers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from katana450 import tolerances
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain

STEPS = 5
"""Angles of each axis at which the change by the exact arm is measured."""


def exact_member(chain: Chain, up: FloatArray) -> tuple[Chain, list[str]]:
    """Return the exact arm for ``chain``, and notes on what the change moves.

    Axes within FAMILY_ANGLE of perpendicular, parallel or upright become so, and a tool point
    within FAMILY_LENGTH of axis 5 is put on it. A chain that is exact within FAMILY_EXACT is
    returned unchanged, without a note.

    Args:
        chain: the arm from the file.
        up: unit vector (3,) that points upwards, in {S}.

    Raises:
        RobotDescriptionError: the chain is outside the family; the message names the axes at fault.
    """
    arm = arm_of(chain)
    z = arm.T_C_S[2, :3]
    lean = math.atan2(float(np.linalg.norm(np.cross(z, up))), abs(float(z @ up)))
    upright = lean <= tolerances.FAMILY_ANGLE
    off = max(arm.skew, lean if upright else 0.0)
    if max(off, arm.gap) <= tolerances.FAMILY_EXACT:
        return chain, []
    T_S_C = se3.inverse(arm.T_C_S)
    if upright:
        T_S_C[:3, :3] = _turn(z, math.copysign(1.0, float(z @ up)) * up) @ T_S_C[:3, :3]
    exact = _exact(chain, arm, T_S_C)
    moved, turned = _change(chain, exact)
    offset = (
        f", the tool point is {1e3 * arm.gap:.2g} mm beside the roll axis"
        if arm.gap > tolerances.FAMILY_EXACT
        else ""
    )
    note = (
        "Axes deviate from perpendicular, parallel or upright by up to "
        f"{math.degrees(off):.2g} deg{offset}. This is treated as rounding: the exact arm is used, "
        f"whose tool differs by at most about {1e3 * moved:.1g} mm and "
        f"{math.degrees(turned):.1g} deg."
    )
    return exact, [note]


def _exact(chain: Chain, arm: FiveAxisArm, T_S_C: FloatArray) -> Chain:
    """Return the canonical arm as a chain in {S}; ``T_S_C`` (4, 4) is the pose of {C}."""
    bearings = np.cumsum(arm.shifts[1:4])
    links = np.array((arm.l1, arm.l2, arm.l3))
    steps = np.column_stack((np.cos(bearings), np.zeros(3), -np.sin(bearings))) * links[:, None]
    shoulder = np.array((arm.a, 0.0, 0.0))
    elbow, wrist, foot = shoulder + np.cumsum(steps, axis=0)
    foot += np.array((0.0, arm.d, 0.0))
    R_C_K = so3.rotation_y(float(bearings[2]) - arm.tilt)
    y = np.array((0.0, 1.0, 0.0))
    roll = arm.signs[4] * R_C_K[:, 0]
    directions = (np.array((0.0, 0.0, arm.signs[0])), *(s * y for s in arm.signs[1:4]), roll)
    points = (np.zeros(3), shoulder, elbow, wrist, foot)
    S_C = [screws.revolute(w, p) for w, p in zip(directions, points, strict=True)]
    home = arm.T_C_S @ chain.M
    # The tool keeps its bearing to the roll axis.
    R_C_tool = _turn(arm.T_C_S[:3, :3] @ chain.S[:3, 4], roll) @ home[:3, :3]
    tool_point = foot + R_C_K @ arm.T_K_tool[:3, 3]
    M = T_S_C @ se3.from_rotation_translation(R_C_tool, tool_point)
    S = screws.moved(T_S_C, np.column_stack(S_C))
    return dataclasses.replace(chain, M=M, S=S)


def _turn(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) that brings direction ``a`` (3,) to ``b`` (3,)."""
    across = np.cross(a, b)
    sine = float(np.linalg.norm(across))
    if sine == 0.0:
        return np.eye(3)
    return so3.exp(across / sine * math.atan2(sine, float(a @ b)))


def _change(chain: Chain, exact: Chain) -> tuple[float, float]:
    """Return the maximum differences [m], [rad] of the tools over a grid within the limits."""
    ranges = np.linspace(chain.lower, chain.upper, STEPS).T
    q = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, chain.n)
    one, other = forward_batch(chain, q), forward_batch(exact, q)
    moved = np.linalg.norm(one[:, :3, 3] - other[:, :3, 3], axis=1)
    # For so small a turn, the norm of the difference is root 2 times the angle.
    turned = np.linalg.norm(one[:, :3, :3] - other[:, :3, :3], axis=(1, 2)) / math.sqrt(2.0)
    return float(moved.max()), float(turned.max())
