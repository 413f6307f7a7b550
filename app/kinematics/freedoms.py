"""The five freedoms of the tool as a person names them: its point, its pitch and its roll.

Pitch is the angle of the roll axis below the horizontal of the canonical arm, roll the turn about
it: for the Katana theta2 + theta3 + theta4 and theta5. Angles in rad.
"""

from __future__ import annotations

import math

import numpy.typing as npt

from app import tolerances
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray
from app.kinematics.arm import arm_of
from app.kinematics.branch import Shoulder
from app.kinematics.chain import Chain


def pitch_and_roll(chain: Chain, q: npt.ArrayLike) -> tuple[float, float]:
    """Pitch and roll at the joint angles `q` (5,)."""
    arm = arm_of(chain)
    _, two, three, four, five = arm.canonical(chain.check_q(q)).tolist()
    return two + three + four - arm.tilt, five


def pitched_frame(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Rotation (3, 3) in {S} of the frame that pan and pitch have turned but roll has not.

    Its x axis is the roll axis, its y axis that of the pitch.
    """
    arm = arm_of(chain)
    pitch, _ = pitch_and_roll(chain, q)
    alpha1 = arm.signs[0] * float(chain.check_q(q)[0])
    R: FloatArray = arm.T_C_S[:3, :3].T @ so3.rotation_z(alpha1) @ so3.rotation_y(pitch)
    return R


def tool_pose(
    chain: Chain, position: FloatArray, pitch: float, roll: float, shoulder: Shoulder, q: FloatArray
) -> FloatArray:
    """T_S_tool (4, 4) that five numbers mean: the roll axis lies in the plane through the point.

    position: (3,) [m] in {S}. shoulder: which way the arm faces it. On axis 1, where that says
    nothing, the arm stays facing as it does at `q` (5,).
    """
    arm = arm_of(chain)
    x, y, _ = (arm.T_C_S[:3, :3] @ position + arm.T_C_S[:3, 3]).tolist()
    rho = math.hypot(x, y)
    if rho <= tolerances.ON_AXIS:
        alpha1 = arm.signs[0] * float(q[0])
    else:
        u = math.sqrt(max(rho - abs(arm.d), 0.0) * (rho + abs(arm.d)))
        alpha1 = math.atan2(y, x) - math.atan2(arm.d, u if shoulder == "front" else -u)
    R_C_K = so3.rotation_z(alpha1) @ so3.rotation_y(pitch) @ so3.rotation_x(roll)
    R = arm.T_C_S[:3, :3].T @ R_C_K @ arm.T_K_tool[:3, :3]
    return se3.from_rotation_translation(R, position)
