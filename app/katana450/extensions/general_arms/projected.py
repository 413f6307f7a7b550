"""The projection of a target onto a posture of an arm outside the five-axis family."""

from __future__ import annotations

import math

import numpy as np

from katana450.extensions.general_arms.nearest import held_by, is_out_of_reach
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
)


def projected(
    chain: Chain, q: FloatArray, T: FloatArray, branch: str, priority: Priority
) -> Projection:
    """Return the projection of the pose `T` (4, 4) that the joint angles `q` (n,) [rad] give."""
    reached = forward(chain, q)
    position = math.dist(reached[:3, 3], T[:3, 3])
    rotation = so3.angle(reached[:3, :3], T[:3, :3])
    turned_off = priority is not Priority.POSITION and rotation > ANGLE_WORTH_TELLING
    missed = position > POSITION_WORTH_TELLING or turned_off
    limits = held_by(chain, np.asarray(q), reached, T) if missed else ()
    return Projection(
        T=frozen(reached),
        q=frozen(q),
        branch=branch,
        position_error=position,
        rotation_error=rotation,
        yaw_error=0.0,
        pitch_error=0.0,
        roll_error=0.0,
        limits=limits,
        axis1=False,
        reach=position > POSITION_WORTH_TELLING
        and not limits
        and is_out_of_reach(chain, np.asarray(q), reached, T),
    )
