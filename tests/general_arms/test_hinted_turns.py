"""The hint chooses the full turn of a joint whose limits hold more than one."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.nearest import nearest_posture
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.turns import nearest_turn
from tests.general_arms.published_arms import IIWA_7, KR_6, PANDA, SKEWED_6, SKEWED_7


def with_limits(chain: Chain, axes: tuple[int, ...], lower: float, upper: float) -> Chain:
    """Return ``chain`` with other limits [rad] of some axes."""
    low, high = np.array(chain.lower), np.array(chain.upper)
    low[list(axes)], high[list(axes)] = lower, upper
    return dataclasses.replace(chain, lower=low, upper=high)


TURNS = 2.0 * math.pi
CHAINS = {
    "six numerical": with_limits(SKEWED_6, (0, 3, 5), -TURNS, TURNS),
    "six closed": with_limits(KR_6, (0, 3, 5), -TURNS, TURNS),
    "seven numerical": with_limits(SKEWED_7, (0, 2, 4, 6), -TURNS, TURNS),
    "seven, swivel 3": with_limits(IIWA_7, (0, 2, 4, 6), -TURNS, TURNS),
    "seven, swivel 7": with_limits(PANDA, (0, 2, 4, 6), -TURNS, TURNS),
    "one side": with_limits(IIWA_7, (0, 2, 4, 6), 0.0, 2.0 * TURNS),
}


@pytest.mark.parametrize("name", CHAINS)
def test_posture_at_the_hint_is_found_again(name: str) -> None:
    chain = CHAINS[name]
    solver = kinematics_of(chain)
    rng = np.random.default_rng(1)
    for q in rng.uniform(chain.lower, chain.upper, (15, chain.n)):
        T = forward(chain, q)
        found = [each for each in solver.inverse(T, q) if each.exact and each.within_limits]
        assert min(np.abs(each.q - q).max() for each in found) < 1e-4
        np.testing.assert_allclose(nearest_posture(solver, T, q_hint=q).q, q, atol=1e-4)


def test_pose_out_of_reach_keeps_the_turn_of_the_hint() -> None:
    chain = CHAINS["six numerical"]
    hint = np.array([5.0, 0.3, -0.4, -4.0, 0.5, 4.5])
    T = forward(chain, hint)
    T[:3, 3] *= 4.0
    q = nearest_posture(kinematics_of(chain), T, q_hint=hint).q
    assert np.abs(q[[0, 3]] - hint[[0, 3]]).max() <= math.pi


def test_nearest_turn_is_inside_the_limits() -> None:
    wide = with_limits(KR_6, tuple(range(6)), -2.0 * TURNS, 2.0 * TURNS)
    q, hint = np.full(6, 0.3), np.full(6, 12.5)
    # Two turns more are beyond the limit.
    np.testing.assert_allclose(nearest_turn(wide, q, hint), 0.3 + TURNS)
