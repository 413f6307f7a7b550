"""The hint chooses between whole turns, for every solver."""

from __future__ import annotations

import dataclasses

import numpy as np

from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.nearest import nearest_pose
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.turns import nearest_turn
from tests.general_arms.published_arms import OPENMANIPULATOR_X, UR5E, XARM_6, XARM_7
from tests.kinematics.conftest import katana

NEAR = 0.06
"""[rad] How far seven axes may leave the hint for more room to the limits."""


def turning_twice(chain: Chain) -> Chain:
    """Return ``chain`` with limits of a whole turn to both sides."""
    ends = np.full(chain.n, 2.0 * np.pi)
    return dataclasses.replace(chain, lower=-ends, upper=ends)


ARMS = {
    "Katana": turning_twice(katana()),
    "OpenMANIPULATOR-X": turning_twice(OPENMANIPULATOR_X),
    "UR5e": UR5E,
    "xArm6": XARM_6,
    "xArm7": XARM_7,
}


def test_posture_that_is_the_hint_comes_back_in_its_turns() -> None:
    rng = np.random.default_rng(3)
    lost = []
    for name, chain in ARMS.items():
        for q in rng.uniform(chain.lower, chain.upper, (6, chain.n)):
            solutions = kinematics_of(chain).inverse(forward(chain, q), q)
            usable = [x.q for x in solutions if x.exact and x.within_limits]
            if not usable or np.abs(np.array(usable) - q).max(axis=1).min() > NEAR:
                lost.append(f"{name} at {q}")
    assert not lost


def test_nearest_pose_is_in_the_turns_of_the_hint() -> None:
    lost = []
    for name in ("UR5e", "xArm6", "xArm7"):
        chain = ARMS[name]
        hint = np.where(chain.upper > 6.0, 5.0, 0.5 * (chain.lower + chain.upper))
        T = forward(chain, hint)
        T[:3, 3] *= 3.0
        best = nearest_pose(kinematics_of(chain), T, q_hint=hint)
        lead = float(np.abs(best.q - hint)[chain.upper > 6.0].max())
        # The upper limit is nearer than half a turn.
        if best.position_error < 0.1 or lead > 2.0 * np.pi - (6.28 - 5.0):
            lost.append(f"{name}: {lead}")
    assert not lost


def test_turn_is_the_nearest_inside_the_limits() -> None:
    chain = dataclasses.replace(
        katana(), lower=np.full(5, -np.pi), upper=np.array([5.0, 5.0, 3.0, 5.0, 2.0]) * np.pi
    )
    q = np.array([[1.0, 1.0, 3.1, -1.0, 0.5]] * 2)
    turned = nearest_turn(chain, q, np.array([14.0, 40.0, -9.0, 6.0, 9.0])) - q
    expected = np.array([2.0, 2.0, 0.0, 1.0, 0.0]) * 2.0 * np.pi
    np.testing.assert_allclose(turned, [expected] * 2, atol=1e-12)
