from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, branch_of
from katana450.maths.kinematics.canonical_target import PlaneOrientation
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse_batch import inverse_batch
from katana450.maths.kinematics.solution import Solution
from katana450.maths.kinematics.solver import inverse

POSES = 2000
# [m] and [rad]: double precision over half a metre leaves about 1e-16.
POSITION, ROTATION = 2e-15, 1e-12


Solved = list[tuple[FloatArray, FloatArray, Sequence[Solution]]]


@pytest.fixture(scope="module")
def solved(chain: Chain) -> Solved:
    """Return (q, T, inverse(T)) of joint vectors anywhere inside the limits."""
    rng = np.random.default_rng(2013)
    result: Solved = []
    for q in rng.uniform(chain.lower, chain.upper, size=(POSES, 5)):
        T = forward(chain, q)
        result.append((q, T, inverse(chain, T)))
    return result


def errors(chain: Chain, q: FloatArray, T: FloatArray) -> tuple[float, float]:
    reached = forward(chain, q)
    return (
        float(np.linalg.norm(reached[:3, 3] - T[:3, 3])),
        so3.angle(reached[:3, :3], T[:3, :3]),
    )


def assert_all_exact(
    chain: Chain, T: FloatArray, solutions: Sequence[Solution], rotation: float = ROTATION
) -> None:
    assert len(solutions) == 4
    for s in solutions:
        position_error, rotation_error = errors(chain, s.q, T)
        assert position_error <= POSITION
        assert rotation_error <= rotation


def contains(solutions: Sequence[Solution], q: FloatArray, within: float) -> bool:
    return any(np.abs(np.exp(1j * s.q) - np.exp(1j * q)).max() < within for s in solutions)


def test_consistency_every_solution_takes_the_pose(chain: Chain, solved: Solved) -> None:
    for _, T, solutions in solved:
        assert_all_exact(chain, T, solutions)


def test_errors_are_those_forward_kinematics_measures(chain: Chain, solved: Solved) -> None:
    for _, T, solutions in solved[:200]:
        for s in solutions:
            measured = errors(chain, s.q, T)
            assert (s.position_error, s.rotation_error) == pytest.approx(measured, abs=1e-15)


def test_inclusion_original_is_among_the_solutions(chain: Chain, solved: Solved) -> None:
    for q, _, solutions in solved:
        original = solutions[BRANCHES.index(branch_of(chain, q))]
        np.testing.assert_allclose(original.q, q, atol=1e-9)
        assert original.within_limits


def test_completeness_one_solution_per_branch(chain: Chain, solved: Solved) -> None:
    for _, _, solutions in solved:
        assert tuple(s.branch for s in solutions) == BRANCHES
        assert tuple(branch_of(chain, s.q) for s in solutions) == BRANCHES


def test_strictness_limits_are_checked_correctly(chain: Chain, solved: Solved) -> None:
    counts = []
    for _, _, solutions in solved:
        for s in solutions:
            inside = bool(((s.q >= chain.lower - 1e-9) & (s.q <= chain.upper + 1e-9)).all())
            assert s.within_limits == inside
            for turns in (-math.tau, math.tau):
                other = s.q + turns
                fits = (other >= chain.lower) & (other <= chain.upper)
                outside = (s.q < chain.lower) | (s.q > chain.upper)
                assert not (fits & outside).any()
        counts.append(sum(s.within_limits for s in solutions))
    assert min(counts) >= 1
    assert max(counts) == 4
    assert 2.0 < np.mean(counts) < 2.4


@pytest.mark.parametrize("bend", [0.0, 1e-12, -1e-9, 1e-7, -1e-5, 1e-3])
def test_near_the_stretched_arm(chain: Chain, bend: float) -> None:
    q = np.array([0.4, -0.7, bend, 0.6, -0.8])
    T = forward(chain, q)
    solutions = inverse(chain, T)
    assert_all_exact(chain, T, solutions)
    # Rounding in the distance shoulder-wrist grows as its square root in the bend.
    assert contains(solutions, q, 1e-7)


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_near_the_folded_arm(chain: Chain, gap: float, sign: float) -> None:
    q = np.array([-1.0, -0.7, sign * (math.pi - gap), 0.6, 2.0])
    T = forward(chain, q)
    solutions = inverse(chain, T)
    assert_all_exact(chain, T, solutions)
    assert contains(solutions, q, 1e-6)
    assert not any(s.within_limits for s in solutions)


def tool_over_shoulder(chain: Chain, q: FloatArray, r: float) -> FloatArray:
    """Return `q` with theta1 = 0 and theta2 such that the tool point's radius is `r` [m]."""
    q = np.array([0.0, *q[1:]])
    x, _, z = forward(chain, q)[:3, 3]
    q[1] += math.asin(r / math.hypot(x, z)) - math.atan2(x, z)
    assert forward(chain, q)[0, 3] == pytest.approx(r, abs=1e-15)
    return q


def test_tool_point_on_axis_1(chain: Chain) -> None:
    for theta1 in (-2.5, 0.0, 1.3):
        q = tool_over_shoulder(chain, np.array([0.0, 0.0, 1.1, 0.7, 0.5]), 0.0)
        q[0] = theta1
        T = forward(chain, q)
        for x, y in ((0.0, 0.0), (1e-17, -1e-17), (T[0, 3], T[1, 3])):
            T[:2, 3] = x, y
            solutions = inverse(chain, T)
            assert_all_exact(chain, T, solutions)
            assert contains(solutions, q, 1e-12)


@pytest.mark.parametrize("r", [1e-8, -1e-6, 1e-3])
def test_tool_point_near_axis_1(chain: Chain, r: float) -> None:
    q = tool_over_shoulder(chain, np.array([0.0, 0.0, 1.1, 0.7, 0.5]), r)
    q[0] = 1.3
    T = forward(chain, q)
    solutions = inverse(chain, T)
    # The direction from axis 1 to the tool point is known to rounding over their distance.
    assert_all_exact(chain, T, solutions, rotation=1e-15 / abs(r) + ROTATION)
    assert contains(solutions, q, 1e-15 / abs(r) + 1e-12)


@pytest.mark.parametrize("pitch", [-math.pi / 2, math.pi / 2])
def test_tool_vertical(chain: Chain, pitch: float) -> None:
    theta2, theta3 = -1.0, 0.9
    q = np.array([0.8, theta2, theta3, pitch - theta2 - theta3, 1.1])
    T = forward(chain, q)
    solutions = inverse(chain, T)
    assert_all_exact(chain, T, solutions)
    assert contains(solutions, q, 1e-12)


@pytest.mark.parametrize("hint", [None, 0.6, -2.9, 3.1, 1e6])
def test_tool_vertical_on_axis_1_leaves_theta1_to_the_hint(
    chain: Chain, hint: float | None
) -> None:
    """The hint chooses theta1 in any turn; the other shoulder differs by half a turn."""
    # The wrist is straight above the shoulder, and the tool points up.
    T = se3.from_rotation_translation(
        so3.rotation_z(0.9) @ so3.rotation_y(-math.pi / 2), [0.0, 0.0, 0.55]
    )
    q_hint = None if hint is None else [hint, 0.0, 0.0, 0.0, 0.0]
    solutions = inverse(chain, T, q_hint=q_hint)
    assert_all_exact(chain, T, solutions)
    for s, half in zip(solutions, (0.0, 0.0, math.pi, math.pi), strict=True):
        desired = math.remainder((hint or 0.0) + half, math.tau)
        assert math.remainder(s.q[0] - desired, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert abs(s.q[0]) <= math.pi


def test_wrist_on_axis_1(chain: Chain) -> None:
    q = np.array([0.5, 0.0, 1.2, 0.4, -0.6])
    x, z = 0.190 + 0.139 * math.cos(1.2), -0.139 * math.sin(1.2)
    q[1] = -math.pi / 2 - math.atan2(-z, x)
    T = forward(chain, q)
    wrist = T[:3, 3] - 0.3028 * T[:3, 0]
    np.testing.assert_allclose(wrist[:2], 0.0, atol=1e-15)
    solutions = inverse(chain, T)
    assert_all_exact(chain, T, solutions)
    assert contains(solutions, q, 1e-12)


def test_at_the_edge_of_the_workspace(chain: Chain) -> None:
    for q in ([0.0] * 5, [0.7, -1.1, 0.0, 0.0, 0.3]):
        T = forward(chain, q)
        solutions = inverse(chain, T)
        assert_all_exact(chain, T, solutions)
        assert contains(solutions, np.array(q), 1e-7)


def test_beyond_reach_the_errors_give_the_distance(chain: Chain) -> None:
    T = forward(chain, [0.4, -0.3, 0.0, 0.0, 0.2])
    T[:3, 3] *= 1.1
    solutions = inverse(chain, T)
    assert len(solutions) == 4
    front = solutions[0]
    assert front.position_error == pytest.approx(0.06318, abs=1e-12)
    assert front.rotation_error < 1e-7
    for s in solutions:
        assert (s.position_error, s.rotation_error) == pytest.approx(errors(chain, s.q, T))


def test_infeasible_orientation_is_reported_as_rotation_error(chain: Chain) -> None:
    T = forward(chain, [0.4, -0.9, 0.8, 0.5, 0.2])
    T[:3, :3] = so3.rotation_z(0.1) @ T[:3, :3]
    for s in inverse(chain, T):
        assert (s.position_error, s.rotation_error) == pytest.approx(errors(chain, s.q, T))
        assert max(s.position_error, s.rotation_error) > 1e-3


def sideways(theta1: float, pitch: float) -> FloatArray:
    """Return a rotation whose x axis is perpendicular to the arm's plane at `theta1`."""
    return so3.rotation_z(theta1 + 0.5 * math.pi) @ so3.rotation_x(pitch)


def test_the_roll_is_the_nearest_for_the_pitch(chain: Chain, rng: np.random.Generator) -> None:
    p = np.array([0.3, 0.15, 0.1])
    facing = math.atan2(p[1], p[0])
    rotations = [so3.exp(2.0 * rng.normal(size=3)) for _ in range(50)]
    rotations += [sideways(facing, pitch) for pitch in (0.0, 0.7, math.pi, -2.0)]
    rotations += [
        sideways(facing, 1.0) @ so3.exp(size * rng.normal(size=3)) for size in (1e-9, 1e-4)
    ]
    for R in rotations:
        for s in inverse(chain, se3.from_rotation_translation(R, p)):
            theta1, theta2, theta3, theta4, theta5 = s.angles
            asked = PlaneOrientation.of(R).seen_from(theta1)
            phi = theta2 + theta3 + theta4
            nearest = asked.best_roll(phi)
            assert s.rotation_error == pytest.approx(asked.angle(phi, nearest), abs=1e-7)
            assert math.cos(theta5 - nearest) > 1.0 - 1e-9


def test_solutions_are_a_sequence_created_once(chain: Chain) -> None:
    solutions = inverse(chain, chain.M)
    assert isinstance(solutions, Sequence)
    assert len(solutions) == len(BRANCHES)
    assert all(a is b for a, b in zip(solutions, solutions, strict=True))
    assert solutions[-1] is solutions[3]
    assert solutions[1:3] == (solutions[1], solutions[2])
    assert str(solutions) == str(tuple(solutions))
    with pytest.raises(IndexError):
        solutions[4]


def test_the_hint_decides_between_turns(chain: Chain) -> None:
    wide = dataclasses.replace(chain, lower=np.full(5, -7.0), upper=np.full(5, 7.0))
    q = np.array([4.5, -0.8, 1.0, 0.4, -5.0])
    solution = inverse(wide, forward(wide, q), q_hint=q + 0.1)[0]
    np.testing.assert_allclose(solution.angles, q, atol=1e-12)


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 2])
def test_limit_beyond_pi_moves_the_solution_into_its_turn(chain: Chain, turns: int) -> None:
    whole = turns * math.tau * np.array([1.0, 0.0, 0.0, 0.0, -1.0])
    shifted = dataclasses.replace(
        chain,
        lower=np.array([0.0, -2.2, -2.1, -2.1, -6.0]) + whole,
        upper=np.array([6.0, 0.2, 2.3, 1.9, 0.1]) + whole,
    )
    q = np.array([4.5, -0.8, 1.0, 0.4, -5.0]) + whole
    solution = inverse(shifted, forward(shifted, q))[0]
    np.testing.assert_allclose(solution.q, q, atol=1e-12)
    assert solution.within_limits
    found = inverse_batch(shifted, forward(shifted, q)[None])
    np.testing.assert_allclose(found[0, 0], q, atol=1e-12)


def test_the_circle_of_the_paper(flange_chain: Chain) -> None:
    # y^2 + (z + 110)^2 = 100^2 at x = 150 mm, the flange pitched 99 degrees below the horizontal.
    pitch = math.radians(99.0)
    worst, margin, fastest, previous = 0.0, math.inf, 0.0, None
    for t in np.linspace(0.0, math.tau, 721):
        p = np.array([0.150, 0.1 * math.cos(t), -0.110 + 0.1 * math.sin(t)])
        R = so3.rotation_z(math.atan2(p[1], p[0])) @ so3.rotation_y(pitch)
        T = se3.from_rotation_translation(R, p)
        solution = inverse(flange_chain, T)[0]
        assert solution.within_limits
        q = solution.q
        worst = max(worst, errors(flange_chain, q, T)[0])
        margin = min(
            margin, float(np.minimum(q - flange_chain.lower, flange_chain.upper - q).min())
        )
        if previous is not None:
            fastest = max(fastest, float(np.abs(q - previous).max()))
        previous = q
    assert worst < 1e-15
    assert math.degrees(margin) == pytest.approx(11.9, abs=0.1)
    millimetres = 100.0 * math.tau / 720
    assert math.degrees(fastest) / millimetres == pytest.approx(0.382, abs=1e-3)


def test_invalid_pose_and_hint_are_refused(chain: Chain) -> None:
    with pytest.raises(InputError, match="not a rotation"):
        inverse(chain, np.diag([1.0, 1.0, 2.0, 1.0]))
    with pytest.raises(InputError, match="axis 1"):
        inverse(chain, chain.M, q_hint=[np.nan, 0.0, 0.0, 0.0, 0.0])
