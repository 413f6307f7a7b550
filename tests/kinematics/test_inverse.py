"""The inverse of the Katana450 and of random members of its family."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import BRANCHES, branch_of
from katana450.maths.kinematics.canonical_target import PlaneOrientation
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse_batch import inverse_batch
from katana450.maths.kinematics.solution import Solution
from katana450.maths.kinematics.solver import Solver, inverse
from tests.conftest import LONG
from tests.kinematics.by_subproblems import matched, same, solve
from tests.kinematics.family import (
    KATANA,
    Offsets,
    arms,
    member,
    random_member,
    random_offsets,
    random_pose,
)

MEMBERS, POSES = 200 if LONG else 80, 10 if LONG else 5
KATANA_POSES = 500 if LONG else 150

POSITION, ROTATION = 1e-14, 1e-12
"""[m] and [rad]; {S} may be two metres away, where forward kinematics is no more accurate."""

KATANA_POSITION = 2e-15
"""[m] Double precision over half a metre leaves about 1e-16."""


class Case(NamedTuple):
    """A pose of an arm, with the joints ``q`` that it was made from, and its inverse."""

    chain: Chain
    offsets: Offsets
    q: FloatArray
    T: FloatArray
    solutions: Sequence[Solution]
    position: float
    """[m] Accuracy of the position."""


@pytest.fixture(scope="module")
def solved(chain: Chain) -> list[Case]:
    """Return cases with joint vectors anywhere inside the limits."""
    rng = np.random.default_rng(25)
    known = [(chain, KATANA, KATANA_POSES, KATANA_POSITION)]
    known += [(*random_member(rng), POSES, POSITION) for _ in range(MEMBERS)]
    cases = []
    for arm, offsets, number, position in known:
        for q in rng.uniform(arm.lower, arm.upper, size=(number, 5)):
            T = forward(arm, q)
            cases.append(Case(arm, offsets, q, T, inverse(arm, T), position))
    return cases


def errors(chain: Chain, q: FloatArray, T: FloatArray) -> tuple[float, float]:
    reached = forward(chain, q)
    distance = float(np.linalg.norm(reached[:3, 3] - T[:3, 3]))
    return distance, so3.angle(reached[:3, :3], T[:3, :3])


def test_consistency_exact_solutions_take_the_pose(solved: list[Case]) -> None:
    for case in solved:
        for s in case.solutions:
            position, rotation = errors(case.chain, s.q, case.T)
            assert s.position_error == pytest.approx(position, abs=1e-15)
            assert s.rotation_error == pytest.approx(rotation, abs=1e-12)
            if s.exact:
                assert position < case.position
                assert rotation < ROTATION


def test_correctness_solutions_equal_those_of_the_subproblems(solved: list[Case]) -> None:
    for chain, _, _, T, solutions, _ in solved:
        exact = [s.q for s in solutions if s.exact]
        specified = [q for q in solve(chain, T) if np.abs(forward(chain, q) - T).max() < 1e-9]
        assert matched(exact, specified, 1e-6)


def test_inclusion_the_original_is_on_its_branch(solved: list[Case]) -> None:
    for chain, offsets, q, _, solutions, _ in solved:
        original = solutions[BRANCHES.index(branch_of(chain, q))]
        assert original.exact
        assert original.within_limits
        assert same(original.q, q, 1e-9 if offsets is KATANA else 1e-7)


def test_completeness_offsets_determine_the_number_of_solutions(solved: list[Case]) -> None:
    counts: dict[bool, set[int]] = {True: set(), False: set()}
    for chain, offsets, _, _, solutions, _ in solved:
        exact = [s for s in solutions if s.exact]
        assert tuple(s.branch for s in solutions) == BRANCHES
        assert all(branch_of(chain, s.q) == s.branch for s in exact)
        if offsets.lateral == offsets.radial == offsets.roll_offset == 0.0:
            assert len(exact) == 4
        counts[offsets.lateral != 0.0].add(len(exact))
    # Beside axis 1 one plane holds the roll axis; through axis 1 the plane has two sides.
    assert counts == {True: {2}, False: {2, 4}}


def test_strict_limits_are_reported_correctly(solved: list[Case]) -> None:
    for chain, _, _, _, solutions, _ in solved:
        for s in solutions:
            inside = bool(((s.q >= chain.lower - 1e-9) & (s.q <= chain.upper + 1e-9)).all())
            assert s.within_limits == inside
            for turns in (-math.tau, math.tau):
                other = s.q + turns
                fits = (other >= chain.lower) & (other <= chain.upper)
                outside = (s.q < chain.lower) | (s.q > chain.upper)
                assert not (fits & outside).any()


def at_canonical(chain: Chain, alpha: list[float]) -> tuple[FloatArray, FloatArray]:
    q = arm_of(chain).joints(alpha)
    return q, forward(chain, q)


def assert_exact(chain: Chain, q: FloatArray, T: FloatArray, within: float) -> None:
    """Check that `q` is found, and that every branch that takes the pose takes it exactly.

    Without offsets all four do. Beside axis 1 the other shoulder is ignored: where the two planes
    nearly meet, it takes nearly
    the same pose as the first.
    """
    solutions = [s for s in inverse(chain, T) if s.exact]
    assert any(same(s.q, q, within) for s in solutions)
    assert len(solutions) == 4 or not arm_of(chain).is_mirrored
    if arm_of(chain).d != 0.0:
        both = [
            [s for s in solutions if str(s.branch).startswith(side)] for side in ("front", "back")
        ]
        both = [side for side in both if side]
        solutions = min(both, key=lambda side: max(s.rotation_error for s in side))
    assert len(solutions) >= 2
    assert max(s.position_error for s in solutions) < POSITION
    assert max(s.rotation_error for s in solutions) < ROTATION


@pytest.mark.parametrize(
    ("three", "within"),
    [(0.0, 1e-6), (1e-9, 1e-6), (math.pi, 1e-6), (math.pi - 1e-7, 1e-6), (1e-4, 1e-9)],
)
def test_stretched_and_folded(three: float, within: float, rng: np.random.Generator) -> None:
    for chain in arms(rng, 60 if LONG else 30):
        q, T = at_canonical(chain, [*rng.uniform(-3.0, 3.0, 2), three, *rng.uniform(-3.0, 3.0, 2)])
        assert_exact(chain, q, T, within)


@pytest.mark.parametrize("u", [0.0, 1e-15, 1e-12, -1e-9, 1e-7, -1e-5, 1e-3])
def test_tool_point_on_and_near_axis_1(u: float, rng: np.random.Generator) -> None:
    """Test a tool point at the distance u from axis 1, or from the cylinder about it."""
    for chain in arms(rng, 90 if LONG else 40):
        arm = arm_of(chain)
        two, three, four = rng.uniform(-3.0, 3.0, 3)
        reach = np.cumsum([two, three, four])
        lengths = np.array([arm.l1, arm.l2, arm.l3])
        x, z = lengths @ np.cos(reach), lengths @ np.sin(reach)
        if math.hypot(x, z) <= abs(u - arm.a):
            continue
        two += math.acos((u - arm.a) / math.hypot(x, z)) - math.atan2(z, x)
        q, T = at_canonical(chain, [1.3, two, three, four, 0.6])
        assert_exact(chain, q, T, 1e-7)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-10])
def test_tool_upright(pitch: float, rng: np.random.Generator) -> None:
    for chain in arms(rng, 60):
        two, three = rng.uniform(-3.0, 3.0, 2)
        four = pitch + arm_of(chain).tilt - two - three
        q, T = at_canonical(chain, [0.7, two, three, four, -0.9])
        assert_exact(chain, q, T, 1e-9)


def by_axis_1(
    chain: Chain, u: float, tip: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray] | None:
    """Return joints and pose, tool point at `u` [m] and tool `tip` [rad] from upright."""
    arm = arm_of(chain)
    phi = float(rng.choice((-1.0, 1.0))) * 0.5 * math.pi + tip + arm.tilt
    out = u - arm.a - arm.l3 * math.cos(phi)
    least, most = max(abs(arm.l1 - arm.l2), abs(out)) + 0.005, arm.l1 + arm.l2 - 0.005
    if least >= most:
        return None
    rho = float(rng.uniform(least, most))
    three = math.acos((rho**2 - arm.l1**2 - arm.l2**2) / (2.0 * arm.l1 * arm.l2))
    bearing = math.atan2(arm.l2 * math.sin(three), arm.l1 + arm.l2 * math.cos(three))
    two = math.atan2(math.sqrt(rho**2 - out**2), out) - bearing
    one, five = rng.uniform(-3.0, 3.0, 2)
    return at_canonical(chain, [one, two, three, phi - two - three, five])


@pytest.mark.cases(9)
@pytest.mark.parametrize("distance", [10.0**k for k in range(-15, -2)])
@pytest.mark.parametrize("lateral", [False, True])
def test_near_axis_1_no_digit_is_lost(
    lateral: bool, distance: float, rng: np.random.Generator
) -> None:
    """Test tools in any direction, also upright, where direction and place tell equally little.

    The accuracy must be that far from the axis. {S} is near the arm, so that rounding in the
    forward kinematics does not dominate.
    """
    number = 0
    while number < (60 if LONG else 25):
        offsets = random_offsets(rng, lateral=lateral)
        chain = member(offsets, np.eye(4), np.eye(4))
        sign, scale = float(rng.choice((-1.0, 1.0))), rng.uniform(1.0, 9.0)
        case = by_axis_1(chain, sign * scale * distance, 10.0 ** rng.uniform(-15.0, 0.0), rng)
        if case is None:
            continue
        number += 1
        solutions = inverse(chain, case[1])
        best = min(solutions, key=lambda s: s.position_error + s.rotation_error)
        assert best.position_error < 2e-15
        assert best.rotation_error < 1e-12


def test_inside_the_lateral_offset_the_smallest_error_is_reported(rng: np.random.Generator) -> None:
    offsets = Offsets(0.03, 0.05, (0.2, 0.2, 0.15), (0.0, 0.0, 0.0), 0.0, (1, 1, 1, 1, 1))
    chain = member(offsets, np.eye(4), np.eye(4))
    for rho in (0.0, 1e-10, 0.01, 0.049):
        facing = float(rng.uniform(-3.0, 3.0))
        p = [rho * math.cos(facing), rho * math.sin(facing), 0.25]
        T = se3.from_rotation_translation(so3.exp([0.1, 0.2, 0.3]), p)
        for s in inverse(chain, T):
            assert s.position_error == pytest.approx(0.05 - rho, abs=1e-9)
            assert not s.exact


def test_a_tool_point_beside_the_roll_axis_is_solved(rng: np.random.Generator) -> None:
    for chain in arms(rng, 50):
        other = chain.with_tool(chain.M @ random_pose(rng, 0.05))
        assert arm_of(other).off_axis > 1e-4
        q = rng.uniform(chain.lower, chain.upper)
        solutions = inverse(other, forward(other, q))
        assert any(s.exact and same(s.q, q, 1e-6) for s in solutions)


def test_rounding_in_a_file_keeps_a_solution_exact(rng: np.random.Generator) -> None:
    """Also test near axis 1, where theta1 magnifies rounding.

    A wrong yaw does not count as rounding.
    """
    for number in range(200 if LONG else 60):
        chain, _ = random_member(rng)
        if number % 2:
            chain = chain.with_tool(chain.M @ random_pose(rng, 0.03))
        S = np.array(chain.S)
        for k in range(5):
            skew = so3.exp(10.0 ** rng.uniform(-8.0, -5.0) * rng.normal(size=3))
            S[:, k] = screws.revolute(skew @ S[:3, k], screws.point_on(S[:, k]))
        chain = dataclasses.replace(chain, S=S)
        arm = arm_of(chain)
        q = rng.uniform(chain.lower, chain.upper)
        T = forward(chain, q)
        solutions = inverse(chain, T)
        off = [np.abs(np.angle(np.exp(1j * (s.q - q)))).max() for s in solutions]
        assert solutions[int(np.argmin(off))].exact
        T_C_K = arm.pose(T)
        level = math.hypot(*T_C_K[:2, 0])
        if math.hypot(*T_C_K[:2, 3]) > 0.2 * arm.reach + abs(arm.d) and level > 0.1:
            T[:3, :3] = so3.exp(0.01 / level * arm.T_C_S[2, :3]) @ T[:3, :3]
            assert not any(s.exact for s in inverse(chain, T))


def test_every_finite_pose_has_finite_angles(rng: np.random.Generator) -> None:
    for chain in arms(rng, 30):
        arm = arm_of(chain)
        corners = [so3.from_rpy(*(0.5 * math.pi * rng.integers(-2, 3, size=3))) for _ in range(3)]
        for R in (*corners, so3.exp(rng.normal(size=3))):
            for size in (0.0, 1e-300, 1e-12, 0.3, 1e3, 1e300):
                T_C_K = se3.from_rotation_translation(R, size * rng.normal(size=3) / 3.0)
                T = se3.inverse(arm.T_C_S) @ T_C_K @ arm.T_K_tool
                for q in Solver.of(chain).solve(T.tolist()):
                    assert np.isfinite(q).all()


def test_beyond_reach_the_arm_points_towards_the_target(rng: np.random.Generator) -> None:
    for chain in arms(rng, 30, lateral=False):
        arm = arm_of(chain)
        _, T = at_canonical(chain, [0.4, -0.3, 0.0, 0.2, 0.5])
        T_C_K = arm.pose(T)
        T_C_K[:3, 3] += 0.2 * np.array(so3.rotation_z(0.4) @ so3.rotation_y(-0.3))[:, 0]
        away = se3.inverse(arm.T_C_S) @ T_C_K @ arm.T_K_tool
        misses = [s.position_error for s in inverse(chain, away)]
        assert any(miss == pytest.approx(0.2, abs=1e-12) for miss in misses)


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
    for s, half in zip(solutions, (0.0, 0.0, math.pi, math.pi), strict=True):
        assert s.position_error < KATANA_POSITION
        assert s.rotation_error < ROTATION
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
    assert_exact(chain, q, T, 1e-12)


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
            orientation = PlaneOrientation.of(R).seen_from(theta1)
            phi = theta2 + theta3 + theta4
            nearest = orientation.best_roll(phi)
            assert s.rotation_error == pytest.approx(orientation.angle(phi, nearest), abs=1e-7)
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
    batch = inverse_batch(shifted, forward(shifted, q)[None])
    np.testing.assert_allclose(batch[0, 0], q, atol=1e-12)


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
