"""The velocity ellipsoid of the tool point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body


@dataclass(frozen=True, eq=False)
class VelocityEllipsoid:
    """Velocities of the tool point with joint rates of unit norm.

    Attributes:
        axes: principal directions in {S} as columns (3, 3), right-handed.
        radii: radii (3,) [m/rad] in falling order. Where a radius is 0 the arm cannot move the tool
            point in that direction.
    """

    axes: FloatArray
    radii: FloatArray


def velocity_ellipsoid(chain: Chain, q: npt.ArrayLike) -> VelocityEllipsoid:
    """Return the ellipsoid of the tool point's translational Jacobian at `q` (n,) [rad]."""
    R = forward(chain, q)[:3, :3]
    axes, radii, _ = np.linalg.svd(R @ jacobian_body(chain, q)[3:])
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return VelocityEllipsoid(frozen(axes), frozen(radii))
