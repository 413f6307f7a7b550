"""Which kinematics a chain gets, and the condition that it misses otherwise."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import numpy.typing as npt
import pytest

from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
from katana450.extensions.general_arms.links import exact_chain, links_of, reversed_chain
from katana450.extensions.general_arms.nearest import nearest_pose
from katana450.maths.geometry import screws
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import FiveAxisKinematics, Kinematics
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.solver import inverse
from tests.general_arms.published_arms import (
    FOUR,
    IIWA_7,
    KR_6,
    PANDA,
    PINCHERX_100,
    PUMA_560,
    QUARTER,
    SEVEN,
    SIX,
    SKEWED,
    SKEWED_6,
    UR5E,
    XARM_6,
    craig,
    ur5e,
)
from tests.kinematics.conftest import katana

ARMS = FOUR | SIX | SEVEN | SKEWED


@pytest.mark.parametrize("name", ARMS)
def test_dimensions_describe_the_chain(name: str) -> None:
    chain = ARMS[name]
    links = links_of(chain)
    np.testing.assert_allclose(exact_chain(chain, links).S, chain.S, atol=1e-12)
    assert links.rounding < (1e-9, 1e-9)
    again = reversed_chain(reversed_chain(chain))
    np.testing.assert_allclose(again.S, chain.S, atol=1e-12)
    q = np.linspace(0.1, 0.7, chain.n)
    np.testing.assert_allclose(
        np.linalg.inv(forward(reversed_chain(chain), q[::-1])), forward(chain, q), atol=1e-12
    )


@pytest.mark.parametrize(
    ("chain", "method"),
    [
        (PINCHERX_100, "four axes: pan and three parallel"),
        (UR5E, "six axes, three of them parallel"),
        (PUMA_560, "six axes with a spherical wrist"),
        (KR_6, "six axes with a spherical wrist"),
        (PANDA, "seven axes whose arm angle is set by axis 7"),
        (IIWA_7, "seven axes whose arm angle is set by axis 3"),
    ],
)
def test_closed_form_is_chosen_by_the_axes(chain: Chain, method: str) -> None:
    assert kinematics_of(chain).method.startswith("closed form for ")
    assert method in kinematics_of(chain).method
    assert kinematics_of(chain) is kinematics_of(chain)


def test_five_axes_keep_their_own_solver() -> None:
    chain = katana()
    kinematics = kinematics_of(chain)
    assert isinstance(kinematics, FiveAxisKinematics)
    q = np.array([0.3, -1.0, 1.4, 0.3, 0.2])
    T = forward(chain, q)
    solutions = kinematics.inverse(T, q)
    assert [solution.branch for solution in solutions] == [
        solution.branch for solution in inverse(chain, T)
    ]
    assert solutions[0].exact
    np.testing.assert_allclose(solutions[0].q, q, atol=1e-12)
    assert exact_arm(chain).chain is chain


@pytest.mark.parametrize("chain", [PINCHERX_100, katana(), UR5E, XARM_6, PANDA])
def test_every_arm_tells_its_branches_apart_in_the_same_way(chain: Chain) -> None:
    kinematics = kinematics_of(chain)
    for q in np.random.default_rng(9).uniform(chain.lower, chain.upper, (5, chain.n)):
        T, branch = forward(chain, q), kinematics.branch_of(q)
        posture = kinematics.on_branch(T, branch, q)
        assert posture is not None
        np.testing.assert_allclose(forward(chain, posture), T, atol=1e-9)
        assert kinematics.branch_of(posture) == branch
        joint = kinematics.arm_angle_joint
        arm_angle = 0.0 if joint is None else float(q[joint])
        (postures,) = kinematics.at_arm_angles(T[None], np.array([arm_angle]))
        turns = np.abs(np.exp(1j * postures) - np.exp(1j * q)).max(axis=1)
        assert np.nanmin(turns) < 1e-6


LIMITS = ([-2.0] * 6, [2.0] * 6)
OFFSET_TWICE = craig(
    [
        (0.0, 0.0, 0.4, 0.0),
        (-QUARTER, 0.025, 0.0, 0.0),
        (0.0, 0.455, 0.0, 0.0),
        (-QUARTER, 0.035, 0.42, 0.0),
        (QUARTER, 0.009, 0.0, 0.0),
        (-QUARTER, 0.012, 0.08, 0.0),
    ],
    *LIMITS,
)


@pytest.mark.parametrize(
    ("chain", "missing"),
    [
        (SKEWED_6, r"axes 4, 5 and 6 do not meet in one point \(axes 4 and 5 pass .* 30 mm apart"),
        (SKEWED_6, r"axes 2 and 3 are not parallel \(40.1 deg off\)"),
        (OFFSET_TWICE, "axes 4 and 5 pass each other 9 mm apart"),
        (OFFSET_TWICE, "axes 3 and 4 are not parallel"),
        (OFFSET_TWICE, "neither axes 4 and 5 nor axes 5 and 6 meet"),
        (SKEWED["skewed 7"], "whichever joint is locked"),
        (
            craig(
                [(0.0, 0.0, 0.1, 0.0), (0.0, 0.1, 0.0, 0.0), (QUARTER, 0.1, 0.0, 0.0)] * 1,
                [-1.0] * 3,
                [1.0] * 3,
            ),
            "there is no closed form for 3 axes",
        ),
        (
            craig(
                [
                    (0.0, 0.0, 0.1, 0.0),
                    (QUARTER, 0.0, 0.0, 0.0),
                    (0.0, 0.2, 0.0, 0.0),
                    (0.3, 0.2, 0.0, 0.0),
                ],
                [-1.0] * 4,
                [1.0] * 4,
            ),
            r"axes 3 and 4 are not parallel \(17.2 deg off\)",
        ),
        (
            craig(
                [
                    (0.0, 0.0, 0.1, 0.0),
                    (QUARTER, 0.0, 0.0, 0.0),
                    (0.0, 0.2, 0.0, 0.0),
                    (0.0, 0.2, 0.0, 0.0),
                    (0.3, 0.0, 0.1, 0.0),
                ],
                [-1.0] * 5,
                [1.0] * 5,
            ),
            "axis 5 must be perpendicular to axis 4 and is 72.8 deg off",
        ),
    ],
)
def test_missing_condition_is_named(chain: Chain, missing: str) -> None:
    method = kinematics_of(chain).method
    assert method.startswith("numerical, because ")
    assert re.search(missing, method), method


def test_deviation_beyond_rounding_is_no_closed_form() -> None:
    bent = ur5e(twist_4=math.radians(0.1))
    assert kinematics_of(bent).method.startswith("elimination for six axes with an offset wrist")
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.9, 0.6])
    solutions = kinematics_of(bent).inverse(forward(bent, q))
    assert len(solutions) == 8
    assert max(solution.position_error for solution in solutions) < 1e-12
    assert min(float(np.abs(solution.q - q).max()) for solution in solutions) < 1e-9


def test_arm_solves_poses_of_its_own() -> None:
    wrong = {name: notes for name in ARMS if (notes := kinematics_of(ARMS[name]).self_check)}
    assert not wrong

    class Still(Kinematics):
        method, branches = "no motion", ("zero",)

        def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:  # noqa: ARG002
            return Solutions(self.chain, T, [(0.0,) * self.chain.n], self.branches)

    (note,) = Still(UR5E).self_check
    assert note.startswith("8 of 8 poses of the arm itself are not solved")


def test_reach_is_a_close_bound() -> None:
    wrong = []
    for name, chain in ARMS.items():
        turning = dataclasses.replace(
            chain, lower=np.full(chain.n, -math.pi), upper=np.full(chain.n, math.pi)
        )
        q = np.random.default_rng(1).uniform(turning.lower, turning.upper, (20_000, chain.n))
        tips = forward_batch(turning, q)[:, :3, 3] - screws.point_on(chain.S[:, 0])
        farthest = float(np.linalg.norm(tips, axis=1).max())
        if not farthest <= chain.reach <= 1.03 * farthest:
            wrong.append(f"{name}: {chain.reach} beside {farthest}")
    assert not wrong


def test_search_alone_calls_nothing_out_of_reach() -> None:
    rng = np.random.default_rng(4)
    kinematics = kinematics_of(SKEWED_6)
    start = screws.point_on(SKEWED_6.S[:, 0])
    reasons = []
    for q in rng.uniform(SKEWED_6.lower, SKEWED_6.upper, (4, 6)):
        T = forward(SKEWED_6, q)
        way = rng.normal(size=3)
        for ratio in (0.97, 1.03):
            T[:3, 3] = start + ratio * SKEWED_6.reach * way / np.linalg.norm(way)
            reasons.append((ratio > 1.0, nearest_pose(kinematics, T).reason))
    wrong = [reason for is_beyond, reason in reasons if ("its links" in reason) != is_beyond]
    assert not wrong
