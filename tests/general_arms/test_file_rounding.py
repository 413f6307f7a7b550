"""Arms whose file rounds right angles are solved as the file describes them."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.links import exact_chain, links_of
from katana450.extensions.general_arms.numerical import search_of
from katana450.extensions.general_arms.seven_axes import SevenAxes
from katana450.extensions.reachability.reachability import PoseSolver
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.settings import Settings
from tests.general_arms import singular_postures as singular
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.published_arms import (
    IIWA_7,
    KR_6,
    PANDA,
    PINCHERX_100,
    PUMA_560,
    QUARTER,
    UR5E,
    UR5E_FILE,
    WRITTEN,
    ur5e,
)

# Axes 3 and 4 are as far off parallel as some calibrations are.
ALMOST = ur5e(twist_4=3e-8, length_6=4e-8)
ARMS = {
    "almost parallel": ALMOST,
    "UR5e": UR5E,
    "KR 6": KR_6,
    "Puma 560": PUMA_560,
    "Panda": PANDA,
    "iiwa": IIWA_7,
}
ALL = ARMS | {"PincherX-100": PINCHERX_100}
DECIMALS = 8
"""Number of decimals of a file with 1.57079633 for a right angle."""

EXACT = 1e-12
"""[m], [rad]"""


def robot_of(folder: Path, chain: Chain, decimals: int = DECIMALS) -> Robot:
    """Return the robot of a file that gives the rotations of ``chain`` with few decimals."""
    text = re.sub(
        r'rpy="([^"]*)"',
        lambda match: f'rpy="{" ".join(f"{float(x):.{decimals}f}" for x in match[1].split())}"',
        chain_urdf("arm", chain),
    )
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return find_robot(Settings(), path, "tool0").robot


def chain_in(folder: Path, chain: Chain, decimals: int = DECIMALS) -> Chain:
    arm = robot_of(folder, chain, decimals).require_arm()
    return arm.chain_to(arm.default_tool)


def postures(chain: Chain, count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, chain.n))


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", ALL)
def test_kinematics_are_those_of_the_file(tmp_path: Path, name: str) -> None:
    robot = robot_of(tmp_path, ALL[name])
    arm = robot.require_arm()
    chain = arm.chain_to(arm.default_tool)
    links = links_of(chain)
    assert max(*links.rounding, *(abs(math.remainder(t, QUARTER)) for t in links.t)) > 1e-10
    assert (links.rounding[0] > 1e-8) == (name == "almost parallel")
    for q in postures(chain, 10):
        place = robot.frames(robot.joint_values(q, 0.0))["tool0"]
        np.testing.assert_allclose(arm.T_base_shoulder @ forward(chain, q), place, atol=EXACT)
    assert not any("nearest exact arm" in note for note in arm.notes)


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", ARMS)
def test_solutions_take_the_pose_of_the_arm_in_the_file(tmp_path: Path, name: str) -> None:
    chain = chain_in(tmp_path, ARMS[name])
    kinematics = kinematics_of(chain)
    assert isinstance(kinematics, ClosedForm | SevenAxes)
    count = 0
    for q in postures(chain, 30):
        solutions = kinematics.inverse(forward(chain, q), q)
        exact = [solution for solution in solutions if solution.exact]
        assert max(solution.position_error for solution in exact) <= EXACT
        assert max(solution.rotation_error for solution in exact) <= EXACT
        if chain.n == 6:
            away = np.array([solution.q for solution in exact]) - q
            away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
            assert np.abs(away).max(axis=1).min() <= 1e-7
        count += len(exact)
    assert count >= 100


def test_right_angles_are_solved_as_the_maker_writes_them() -> None:
    links = links_of(UR5E_FILE)
    assert links.rounding == (0.0, 0.0)
    assert links.t[0] == pytest.approx(WRITTEN, abs=1e-15)
    kinematics, search = kinematics_of(UR5E_FILE), search_of(UR5E_FILE)
    q = postures(UR5E_FILE, 30)
    T = forward_batch(UR5E_FILE, q)
    worst = []
    for target, angles, batch in zip(T, q, kinematics.inverse_batch(T), strict=True):
        exact = [solution for solution in kinematics.inverse(target) if solution.exact]
        assert len(exact) >= 2
        worst += [max(solution.position_error, solution.rotation_error) for solution in exact]
        worst.append(float(errors_of(UR5E_FILE, batch[None], target[None])[0].min()))
        tip = search.links.T_S_1[:3] @ [*search.motion(angles.tolist())[0][9:], 1.0]
        worst.append(float(np.abs(tip - target[:3, 3]).max()))
    assert max(worst) <= 2e-14


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["almost parallel", "UR5e", "KR 6", "Puma 560"])
def test_postures_near_singularities_are_taken_too(tmp_path: Path, name: str) -> None:
    chain = chain_in(tmp_path, ARMS[name])
    solver = kinematics_of(chain)
    assert isinstance(solver, ClosedForm)
    rng = np.random.default_rng(2)
    near = singular.near_surface(chain, singular.determinant(chain), rng, 40)
    in_line = singular.aligned_wrist(chain, rng, 40, 4, (0.0,))
    q = np.concatenate((near, in_line))
    T = forward_batch(chain, q)
    table = np.array([solver.solve(t, posture.tolist()) for t, posture in zip(T, q, strict=True)])
    distance, turn = errors_of(chain, table, T)
    assert (np.maximum(distance, turn).min(axis=1) <= 1e-9).all()


def test_pose_out_of_reach_keeps_the_nearest_postures(tmp_path: Path) -> None:
    chain = chain_in(tmp_path, UR5E)
    exact = exact_chain(chain, links_of(chain))
    T = np.array(forward(chain, np.zeros(6)))
    T[:3, 3] *= 3.0
    for one, other in zip(
        kinematics_of(chain).inverse(T), kinematics_of(exact).inverse(T), strict=True
    ):
        assert not one.exact
        assert one.position_error == pytest.approx(other.position_error, abs=1e-6)


def test_map_counts_the_poses_of_such_an_arm(tmp_path: Path) -> None:
    chain = chain_in(tmp_path, IIWA_7)
    solver = kinematics_of(chain)
    assert isinstance(solver, SevenAxes)
    T = forward_batch(chain, 0.5 * postures(chain, 20))
    is_taken = PoseSolver(solver, lambda q: np.ones(len(q), dtype=np.bool)).taken(T)
    assert is_taken.mean() >= 0.9


@pytest.mark.parametrize("chain", [UR5E, PANDA])
def test_coarser_file_means_the_exact_arm(tmp_path: Path, chain: Chain) -> None:
    arm = robot_of(tmp_path, chain, 5).require_arm()
    assert any("nearest exact arm" in note for note in arm.notes)
    exact = arm.chain_to(arm.default_tool)
    assert max(links_of(exact).rounding) < 1e-13
    q = postures(exact, 1)[0]
    T = arm.T_base_shoulder @ forward(exact, q)
    np.testing.assert_allclose(T, forward(chain, q), atol=5e-5)
    solutions = kinematics_of(exact).inverse(forward(exact, q))
    assert min(solution.position_error for solution in solutions) < EXACT


def test_four_axes_hold_the_tool_point_and_nearly_the_rotation(tmp_path: Path) -> None:
    chain = chain_in(tmp_path, PINCHERX_100)
    solver = kinematics_of(chain)
    assert isinstance(solver, ClosedForm)
    exact = exact_chain(chain, links_of(chain))
    # Poses of this arm, and poses of the exact arm, which it takes but for the rounding.
    for source in (chain, exact):
        for q in postures(chain, 20):
            exact_solutions = [
                solution for solution in solver.inverse(forward(source, q)) if solution.exact
            ]
            assert len(exact_solutions) == 2
            assert max(solution.position_error for solution in exact_solutions) <= EXACT
            assert max(solution.rotation_error for solution in exact_solutions) <= 1.3e-7
            away = np.array([solution.q for solution in exact_solutions]) - q
            away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
            assert np.abs(away).max(axis=1).min() <= 1e-6
