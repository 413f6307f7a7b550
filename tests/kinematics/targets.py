"""Poses that an arm cannot take, and a check of postures of the Katana450 for them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.projection import Projection

FRONT_UP = Branch("front", "up")


def pose(w: npt.ArrayLike, p: npt.ArrayLike) -> FloatArray:
    return se3.from_rotation_translation(so3.exp(w), p)


def targets(chain: Chain, rng: np.random.Generator, rounds: int) -> list[FloatArray]:
    """Return poses of every kind that the arm cannot take, one of each per round."""
    arm = arm_of(chain)
    T_S_C = se3.inverse(arm.T_C_S)
    result: list[FloatArray] = []
    for _ in range(rounds):
        turned = forward(chain, rng.uniform(chain.lower, chain.upper))
        turned[:3, :3] = turned[:3, :3] @ so3.exp(0.5 * rng.normal(size=3))
        far: FloatArray = rng.normal(size=3)
        far *= rng.uniform(0.6, 1.2) / np.linalg.norm(far)
        behind = math.pi + 0.07 + rng.uniform(-0.25, 0.25)
        beside_axis = [
            *(10.0 ** rng.uniform(-6, -1.5) * rng.normal(size=2)),
            rng.uniform(-0.6, 0.65),
        ]
        places: list[npt.ArrayLike] = [
            far,
            0.12 * rng.normal(size=3),
            [0.4 * math.cos(behind), 0.4 * math.sin(behind), rng.uniform(-0.4, 0.5)],
            beside_axis,
        ]
        result += [
            turned,
            *(T_S_C @ pose(2.0 * rng.normal(size=3), place) @ arm.T_K_tool for place in places),
            forward(chain, rng.uniform(chain.lower - 0.6, chain.upper + 0.6)),
        ]
    return result


def assert_on_branch(p: Projection) -> None:
    """Check that `p` is on `p.branch` or its edge."""
    r = p.T[0, 3] * math.cos(p.q[0]) + p.T[1, 3] * math.sin(p.q[0])
    assert abs(r) < 1e-11 or (r > 0.0) == (p.branch.shoulder == "front")  # type: ignore[union-attr]
    assert p.q[2] == 0.0 or (p.q[2] > 0.0) == (p.branch.elbow == "up")  # type: ignore[union-attr]
