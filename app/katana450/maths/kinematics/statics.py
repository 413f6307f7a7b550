"""Static joint torques of an arm at rest under its own weight.

By virtual work the torque of a joint is the derivative of the potential energy by its angle.
Source: Lynch & Park, Modern Robotics (2017), ch. 5.2 (statics) and 8.1.1 (potential energy).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import jacobian_space, joint_frames

GRAVITY: Final = 9.80665
"""Standard gravity [m/s^2], along -z of {S}."""


@dataclass(frozen=True, eq=False)
class LinkLoad:
    """A mass that moves with the first joints of the arm.

    Attributes:
        axes: the number of joints that move the mass.
        mass: the mass [kg].
        centre: centre of mass (3,) [m] in {S} at q = 0.
    """

    axes: int
    mass: float
    centre: FloatArray


def holding_torques(chain: Chain, q: npt.ArrayLike, loads: Iterable[LinkLoad]) -> FloatArray:
    """Return the torques (n,) [N m] about the joints' axes that hold `loads` at `q` (n,) [rad]."""
    q = chain.check_q(q)
    moved, J = joint_frames(chain, q), jacobian_space(chain, q)
    torques = np.zeros(chain.n)
    for load in loads:
        if load.axes == 0:
            continue
        T, (omega, v) = moved[load.axes - 1], (J[:3, : load.axes], J[3:, : load.axes])
        x, y, _ = T[:3, :3] @ load.centre + T[:3, 3]
        rise = omega[0] * y - omega[1] * x + v[2]
        torques[: load.axes] += GRAVITY * load.mass * rise
    return torques
