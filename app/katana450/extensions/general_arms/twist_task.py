"""The components of a twist that an arm of any number of axes follows in a jog."""

from __future__ import annotations

import numpy as np

from katana450.extensions.general_arms.regularity import Regularity
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.maths.kinematics.velocity import JogFrame, characteristic_length


def twist_task(
    chain: Chain, q: FloatArray, V: FloatArray, frame: JogFrame
) -> tuple[FloatArray, FloatArray]:
    """Return Jacobian (k, n) and task (k,) of the twist `V` (6,), see `velocity.Task`.

    All six components from six axes on. Fewer axes follow the velocity of the tool point, and the
    rotation about their axes from the fourth on.
    """
    R = forward(chain, q)[:3, :3]
    omega, v = (V[:3], V[3:]) if frame is JogFrame.TOOL else (R.T @ V[:3], R.T @ V[3:])
    length = characteristic_length(chain)
    J = jacobian_body(chain, q)
    J[3:] /= length
    if chain.n >= 6:
        return J, np.concatenate((omega, v / length))
    turns = J[:3, min(3, chain.n) :]
    return Regularity(chain.n).matrix(J), np.concatenate((turns.T @ omega, v / length))
