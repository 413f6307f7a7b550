"""Arms whose file writes a parallel axis as 3.1416: their common normal is kilometres away."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.messages import sentence
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.links import links_of
from katana450.extensions.general_arms.numerical import tool_and_jacobian
from katana450.maths.geometry import screws, so3
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from tests.conftest import LONG
from tests.general_arms.driven import begun, pose, session_of, settled
from tests.general_arms.published_arms import KR_6, UR5E
from tests.robot.public_arms import J, written

ROUGH = (
    ((0.0, 0.0, 0.13), (0.0, 0.0, 0.0)),
    ((0.0, -0.03, 0.115), (1.5708, 0.0, 0.0)),
    ((0.0, 0.28, 0.0), (-3.1416, 0.0, 0.0)),
    ((0.0, -0.14, 0.02), (1.5708, 0.0, 0.0)),
    ((0.0285, 0.0, 0.105), (0.0, 1.5708, 0.0)),
    ((-0.105, 0.0, 0.0285), (0.0, -1.5708, 0.0)),
)
"""Places [m] and angles [rad] of six axes about z, of which 2 and 3 are 7.3e-6 rad off parallel."""


@pytest.fixture
def rough(tmp_path: Path) -> Path:
    joints = [
        J(f"j{k}", "revolute", f"l{k - 1}" if k > 1 else "base", f"l{k}", xyz, rpy)
        for k, (xyz, rpy) in enumerate(ROUGH, start=1)
    ]
    tool = J("tool_joint", "fixed", "l6", "tool", (0.0, 0.0, 0.13))
    return written(tmp_path, "rough", [*joints, tool])


def test_every_pose_is_solved(rough: Path) -> None:
    arm = katana450.load(rough)
    rng = np.random.default_rng(1)
    for q in rng.uniform(arm.lower, arm.upper, (25 if LONG else 8, 6)):
        assert arm.ik(arm.fk(q)).feasible
        assert arm.nearest(arm.fk(q)).reason == ""


def test_drags_move_the_tool(rough: Path) -> None:
    session = session_of(katana450.load(rough).chain)
    rng = np.random.default_rng(2)
    for size in (0.03, 0.04, 0.05):
        start = begun(session)
        way = rng.normal(size=3)
        target = pose(session, start)[:3, 3] + size * way / np.linalg.norm(way)
        state = settled(session, start, [cmd.Position(target)])
        np.testing.assert_allclose(pose(session, state)[:3, 3], target, atol=1e-7)


def turned(chain: Chain, axis: int, angle: float) -> Chain:
    """Return ``chain`` with one axis turned by ``angle`` [rad] about a skew line."""
    S = np.array(chain.S)
    w, v = S[:3, axis], S[3:, axis]
    S[:, axis] = screws.revolute(
        so3.exp([0.6 * angle, 0.48 * angle, 0.64 * angle]) @ w, np.cross(w, v)
    )
    return dataclasses.replace(chain, S=S)


@pytest.mark.parametrize("angle", [1e-6, 2e-4, 2e-3, 3e-2])
@pytest.mark.parametrize("chain", [UR5E, KR_6], ids=["UR5e", "KR 6"])
def test_lengths_are_those_of_the_links(chain: Chain, angle: float) -> None:
    rng = np.random.default_rng(3)
    for axis in range(1, 4):
        skew = turned(chain, axis, angle)
        links = links_of(skew, exact=False)
        assert links.reach < 1.5 * links_of(chain, exact=False).reach
        for q in rng.uniform(chain.lower, chain.upper, (3, 6)):
            T = forward(skew, q)
            place = links.T_S_1 @ [*tool_and_jacobian(links)(q.tolist())[0][9:], 1.0]
            np.testing.assert_allclose(place[:3], T[:3, 3], atol=1e-13)
            assert any(solution.exact for solution in kinematics_of(skew).inverse(T))


def test_only_what_is_out_of_reach_is_called_so() -> None:
    session = session_of(UR5E)
    start = begun(session)
    T = pose(session, start)
    # The wrist meets its singularity there, and the tool point could go on.
    for way, words in (
        ((0.0, -0.3, 0.3), "no joint moves the tool"),
        ((3.0, 0.0, 0.0), "reach no"),
    ):
        state = settled(session, start, [cmd.Position(T[:3, 3] + way)])
        assert ("out of reach" in sentence(state)) == (words == "reach no"), sentence(state)
        assert words in sentence(state)
