"""The five freedoms of the tool in an operator's terms: its point, its pitch and its roll.

Pitch is the angle of the roll axis below the horizontal of the canonical arm. Roll is the turn
about the roll axis. For the Katana they are theta2 + theta3 + theta4 and theta5. Angles in rad.
"""

from __future__ import annotations

import numpy.typing as npt

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain


def pitch_and_roll(chain: Chain, q: npt.ArrayLike) -> tuple[float, float]:
    """Return pitch and roll [rad] at the joint angles `q` (5,) [rad]."""
    arm = arm_of(chain)
    alpha = arm.angles(chain.check_q(q))
    return arm.pitch(alpha), alpha[4]


def pitched_frame(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the rotation (3, 3) in {S} of the frame that follows pan and pitch but not roll.

    Its x axis is the roll axis and its y axis is the pitch axis. `q` (5,) are joint angles [rad].
    """
    arm = arm_of(chain)
    pitch, _ = pitch_and_roll(chain, q)
    alpha1 = arm.signs[0] * float(chain.check_q(q)[0])
    R: FloatArray = arm.T_C_S[:3, :3].T @ so3.rotation_z(alpha1) @ so3.rotation_y(pitch)
    return R
