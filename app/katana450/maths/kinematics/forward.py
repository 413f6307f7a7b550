"""Forward kinematics by the product of exponentials, and its Jacobians.

Sources: the paper's eq. (1), (2), (11); Lynch & Park, Modern Robotics (2017), ch. 4.1 and 5.1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry import screws, se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

_IDENTITY = np.eye(4)


def _exponentials(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return exp(hat(S_i) q_i) of every joint, (n, 4, 4)."""
    q = chain.check_q(q)
    # This form of 1 - cos q keeps its digits near 0.
    versine = (2.0 * np.sin(0.5 * q) ** 2)[:, None, None]
    E: FloatArray = chain.sines(q)[:, None, None] * chain.generators
    E += versine * chain.generators_squared
    E += _IDENTITY
    return E


def _tool(chain: Chain, exponentials: FloatArray) -> FloatArray:
    T = chain.M
    for E in exponentials[::-1]:
        T = E @ T
    return T


def _frames(chain: Chain, exponentials: FloatArray) -> FloatArray:
    """Return the products of `exponentials` from the first on, in their place."""
    for i in range(1, chain.n):
        exponentials[i] = exponentials[i - 1] @ exponentials[i]
    return exponentials


def _columns(chain: Chain, before: FloatArray) -> FloatArray:
    J = np.array(chain.S)
    for i in range(1, chain.n):
        J[:, i] = screws.moved(before[i - 1], chain.S[:, i])
    return J


def forward(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return T_S_tool (4, 4) at the joint angles `q` (n,) [rad]: exp(S1 q1) ... exp(Sn qn) M."""
    return _tool(chain, _exponentials(chain, q))


def joint_frames(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return exp(S1 q1) ... exp(Si qi) for i = 1 ... n, (n, 4, 4): each link's motion from home."""
    return _frames(chain, _exponentials(chain, q))


def jacobian_space(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the (6, n) Jacobian: the tool's twist (omega, v) in {S} is J_space @ qd."""
    return _columns(chain, joint_frames(chain, q))


def jacobian_body(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the (6, n) Jacobian: the tool's twist (omega, v) in the tool frame is J_body @ qd."""
    return tool_and_jacobian(chain, q)[1]


def tool_and_jacobian(chain: Chain, q: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return `forward` and `jacobian_body` (6, n) at `q` (n,) [rad], for the cost of one."""
    exponentials = _exponentials(chain, q)
    T = _tool(chain, exponentials)
    J_space = _columns(chain, _frames(chain, exponentials))
    return T, se3.adjoint(se3.inverse(T)) @ J_space
