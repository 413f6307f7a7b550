"""Six axes with an offset wrist: every posture that a search from random postures leads to."""

from __future__ import annotations

import dataclasses
import math
import os
import time

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.tool_targets import branch_options, with_branch
from katana450.errors import InputError
from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.descent import Descent, Regularity
from katana450.extensions.general_arms.numerical import search_of
from katana450.extensions.general_arms.offset_wrist import OffsetWrist
from katana450.extensions.general_arms.pose_equations import PoseEquations
from katana450.extensions.general_arms.seven_axes import SevenAxes
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from tests.general_arms import singular_postures as singular
from tests.general_arms.driven import pose, session_of, settled
from tests.general_arms.published_arms import (
    CRX_10IA,
    JACO_2,
    NEAR_MISS,
    OFFSET,
    QUARTER,
    UF_850,
    XARM_6,
    craig,
)

LONG = "KATANA450_LONG" in os.environ
POSES = 200 if LONG else 1
STARTS = 200 if LONG else 40
NEWTON_STEPS = 40

EXACT = 1e-12
"""[m], [rad] The error that is allowed: 1e-9 mm."""

FOUND = 1e-12
"""[m], [rad] Error at which a search has found a posture."""

SAME = 1e-6
"""[rad] Difference of two postures that are the same."""


def apart(q: FloatArray, others: FloatArray) -> FloatArray:
    """Return the largest turn of a joint (N,) [rad] from ``others`` (N, n) to `q` (n,)."""
    turns = others - q
    turns -= math.tau * np.round(turns / math.tau)
    return np.asarray(np.abs(turns).max(axis=1, initial=0.0))


def searched(
    chain: Chain, T: FloatArray, rng: np.random.Generator, locked: dict[int, float]
) -> FloatArray:
    """Return the postures (k, n) [rad] to which Newton's method leads from random ones."""
    equations = PoseEquations(Descent(search_of(chain), Regularity(chain.n)))
    q = rng.uniform(-math.pi, math.pi, (STARTS, chain.n))
    free = [k for k in range(chain.n) if k not in locked]
    for joint, angle in locked.items():
        q[:, joint] = angle
    for step in range(NEWTON_STEPS):
        reached = forward_batch(chain, q)
        left = T[:3, :3] @ reached[:, :3, :3].swapaxes(1, 2)
        rotation = [left[:, i, j] - left[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))]
        error = np.column_stack((0.5 * np.transpose(rotation), T[:3, 3] - reached[:, :3, 3]))
        J = equations._axes(q)[:, :, free]
        A = J.swapaxes(1, 2) @ J + (1e-6 if step < 30 else 1e-14) * np.eye(len(free))
        steps = np.linalg.solve(A, J.swapaxes(1, 2) @ error[:, :, None])[:, :, 0]
        q[:, free] += np.clip(steps, -1.0, 1.0)
    distance, turn = errors_of(chain, q[:, None], np.broadcast_to(T, (len(q), 4, 4)))
    distinct = np.zeros((0, chain.n))
    for posture in q[np.maximum(distance, turn)[:, 0] <= FOUND]:
        if not (apart(posture, distinct) < SAME).any():
            distinct = np.concatenate((distinct, posture[None]))
    return distinct


def offset_wrist(chain: Chain) -> OffsetWrist:
    kinematics = kinematics_of(chain)
    assert isinstance(kinematics, OffsetWrist), kinematics.method
    return kinematics


@pytest.mark.parametrize("name", OFFSET)
def test_postures_are_those_of_a_search_from_many_starts(name: str) -> None:
    chain = OFFSET[name]
    solver = offset_wrist(chain)
    rng = np.random.default_rng(1)
    counts, searched_counts, worst, seconds = [], [], 0.0, []
    for number, q in enumerate(rng.uniform(-math.pi, math.pi, (POSES, 6))):
        T = forward(chain, q)
        begin = time.thread_time()
        solutions = solver.inverse(T)
        seconds.append(time.thread_time() - begin)
        postures = np.array([solution.q for solution in solutions])
        others = np.concatenate((searched(chain, T, rng, {}), q[None]))
        lost = [other for other in others if apart(other, postures).min() > SAME]
        assert not lost, f"pose {number}: {lost}"
        for k, posture in enumerate(postures):
            assert not (apart(posture, postures[:k]) < SAME).any()
        names = [str(solution.branch) for solution in solutions]
        assert len(set(names)) == len(names)
        assert set(names) <= set(solver.branches)
        errors = [
            max(candidate.position_error, candidate.rotation_error) for candidate in solutions
        ]
        worst = max(worst, *errors)
        counts.append(len(postures))
        searched_counts.append(len(others) - (apart(q, others[:-1]) < SAME).any())
    assert worst <= EXACT
    print(
        f"{name}: {np.bincount(counts).tolist()} poses with 0, 1, 2, ... postures, "
        f"{np.equal(counts, searched_counts).sum()} as many as the search; "
        f"{1e3 * worst:.1e} mm, {1e6 * float(np.median(seconds)):.0f} us"
    )


def random_arm(rng: np.random.Generator) -> Chain:
    """Return an arm whose axes 2 and 3 are parallel, and whose axis 5 meets axis 4 or 6."""

    def twist() -> float:
        return float(rng.choice((QUARTER, -QUARTER, 0.8, -1.1, 2.2)))

    def length() -> float:
        return float(rng.choice((0.0, 1.0)) * rng.uniform(-0.15, 0.15))

    offsets = [0.1 * rng.uniform(), 0.0]
    rng.shuffle(offsets)
    return craig(
        [
            (0.0, 0.0, 0.3, 0.2),
            (twist(), length(), length(), rng.uniform(-1.0, 1.0)),
            (rng.choice((0.0, math.pi)), rng.uniform(0.15, 0.5), length(), rng.uniform(-1.0, 1.0)),
            (twist(), length(), rng.uniform(0.1, 0.5), 0.0),
            (twist(), offsets[0], length(), 0.0),
            (twist(), offsets[1], 0.1, 0.0),
        ],
        [-math.pi] * 6,
        [math.pi] * 6,
    )


def test_arms_of_any_dimensions_are_solved() -> None:
    rng = np.random.default_rng(9)
    for _ in range(300 if LONG else 12):
        chain = random_arm(rng)
        solver = offset_wrist(chain)
        assert len(set(solver.branches)) == len(solver.branches)
        q = rng.uniform(-math.pi, math.pi, (4, 6))
        for posture, row in zip(q, solver.inverse_batch(forward_batch(chain, q)), strict=True):
            postures = row[np.isfinite(row[:, 0])]
            assert apart(posture, postures).min() <= SAME
            assert len(postures) % 2 == 0


def test_rounding_of_a_file_changes_no_name() -> None:
    """The maker writes right angles as 1.5708."""
    for chain in (XARM_6, JACO_2):
        S = np.array(chain.S)
        S[:3, 1:] += np.random.default_rng(10).uniform(-4e-6, 4e-6, (3, 5))
        S[:3] /= np.linalg.norm(S[:3], axis=0)
        S[3:] -= S[:3] * np.einsum("ij,ij->j", S[:3], S[3:])
        rounded = dataclasses.replace(chain, S=S)
        assert offset_wrist(rounded).branches == offset_wrist(chain).branches
        q = np.array([0.3, 1.2, 1.0, 0.4, 0.9, 0.6])
        solutions = kinematics_of(rounded).inverse(forward(rounded, q))
        assert min(float(apart(q, s.q[None])[0]) for s in solutions) <= SAME
        assert max(s.position_error for s in solutions) <= EXACT


def test_pose_has_sixteen_postures() -> None:
    """The pose of a CRX-10iA with 16 postures is among random ones."""
    solver = offset_wrist(CRX_10IA)
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (200, 6))
    table = solver.inverse_batch(forward_batch(CRX_10IA, q))
    counts = np.isfinite(table[:, :, 0]).sum(axis=1)
    assert table.shape == (200, 32, 6)
    assert solver.inverse_batch(np.zeros((0, 4, 4))).shape == (0, 32, 6)
    assert counts.max() == 16
    assert counts.min() >= 4


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["xArm 6", "CRX-10iA", "IRB 140, 20 mm between 4 and 5"])
def test_singular_postures_are_found_again(name: str) -> None:
    """Where two postures meet, the polynomial has a double root.

    A folded CRX-10iA leaves axes 1 and 2 free, which the hint decides.
    """
    chain = OFFSET[name]
    solver = offset_wrist(chain)
    rng = np.random.default_rng(3)
    near = singular.near_surface(chain, singular.determinant(chain), rng, 20 if not LONG else 2000)
    lost = 0
    for q in near:
        T = forward(chain, q)
        solutions = solver.inverse(T, q if name == "CRX-10iA" else None)
        postures = np.array([solution.q for solution in solutions])
        assert max(max(s.position_error, s.rotation_error) for s in solutions) <= EXACT
        # A double root is known to the square root of rounding, and one of more less well.
        lost += apart(q, postures).min() > 1e-4
    assert lost <= 0.03 * len(near)


def test_home_and_other_special_postures_are_found_again() -> None:
    rng = np.random.default_rng(4)
    for name, chain in OFFSET.items():
        for q in rng.choice((0.0, 0.5, 1.0, -0.5), (20 if LONG else 4, 6)) * (0.5 * math.pi):
            solutions = kinematics_of(chain).inverse(forward(chain, q), q)
            errors = [max(s.position_error, s.rotation_error) for s in solutions]
            assert min(errors) <= EXACT, f"{name} at {q}"
            assert apart(q, np.array([s.q for s in solutions])).min() <= 1e-4, f"{name} at {q}"


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", OFFSET)
def test_batch_and_branches_agree_with_single_poses(name: str) -> None:
    chain = OFFSET[name]
    solver = offset_wrist(chain)
    q = np.random.default_rng(5).uniform(-math.pi, math.pi, (6, 6))
    T = forward_batch(chain, q)
    for posture, target, row in zip(q, T, solver.inverse_batch(T), strict=True):
        solutions = solver.inverse(target)
        places = [solver.branches.index(str(solution.branch)) for solution in solutions]
        np.testing.assert_allclose(row[places], [s.q for s in solutions], atol=1e-9)
        assert np.isnan(np.delete(row, places, axis=0)).all()
        for solution in solutions:
            first = "-".join(str(solution.branch).split("-")[:3])
            assert solver.branch_of(solution.q) == first
        same = solver.on_branch(target, solver.branch_of(posture), posture)
        assert same is not None
        assert apart(same, posture[None]) <= 1e-7
    distance, _ = errors_of(chain, solver.inverse_batch(T), T)
    assert np.isinf(distance).any()
    assert distance[np.isfinite(distance)].max() <= EXACT


def test_pose_out_of_reach_has_the_posture_of_the_search() -> None:
    far = se3.from_rotation_translation(np.eye(3), np.array([3.0, 0.2, 0.1]))
    for chain in OFFSET.values():
        (solution,) = kinematics_of(chain).inverse(far)
        assert not solution.exact
        assert np.isfinite(solution.q).all()
        assert solution.position_error > 1.0


def test_turns_are_those_of_the_limits_and_the_hint() -> None:
    solver = offset_wrist(XARM_6)
    rng = np.random.default_rng(6)
    for q in rng.uniform(XARM_6.lower, XARM_6.upper, (30, 6)):
        T = forward(XARM_6, q)
        assert any(s.within_limits and s.exact for s in solver.inverse(T))
        assert min(np.abs(s.q - q).max() for s in solver.inverse(T, q)) <= 1e-6


def test_every_branch_is_taken_or_refused() -> None:
    session = session_of(CRX_10IA)
    arm = session.require_arm()
    rng, branches = np.random.default_rng(8), offset_wrist(CRX_10IA).branches
    occupied: set[str] = set()
    while not 2 <= len(occupied) <= 6:
        q = rng.uniform(-2.0, 2.0, 6)
        occupied = {str(s.branch) for s in kinematics_of(CRX_10IA).inverse(forward(CRX_10IA, q))}
        occupied &= set(branches[:8])
    state = session.begin(q, 0.0, 0.0)
    T, refused = pose(session, state), set()
    for option in branch_options(arm, state):
        name = option.branch
        if option.refusal:
            refused.add(name)
            with pytest.raises(InputError, match=f"No posture of branch {name} has the tool at"):
                with_branch(arm, state, name)
            continue
        end = settled(session, state, [cmd.Branch(name=str(name))])
        assert end.branch == name
        np.testing.assert_allclose(pose(session, end), T, atol=1e-12)
    assert refused == set(branches[:8]) - occupied


def test_other_arms_of_these_makers() -> None:
    assert isinstance(kinematics_of(UF_850), ClosedForm)
    assert exact_arm(XARM_6).chain is XARM_6


@pytest.mark.parametrize("name", NEAR_MISS)
def test_axes_that_almost_meet_have_an_arm_angle(name: str) -> None:
    """At the arm angle of a posture, the postures are those of a search; all are exact."""
    chain = NEAR_MISS[name]
    solver = kinematics_of(chain)
    assert isinstance(solver, SevenAxes)
    rng = np.random.default_rng(7)
    lost = 0
    for q in rng.uniform(chain.lower, chain.upper, (POSES, 7)):
        T = forward(chain, q)
        postures = solver.at_arm_angle_of(T[None], q)[0]
        distance, turn = (error[0] for error in errors_of(chain, postures[None], T[None]))
        exact = postures[np.maximum(distance, turn) <= EXACT]
        assert (np.abs(exact[:, solver.arm_angle_joint] - q[solver.arm_angle_joint]) <= 1e-12).all()
        others = np.concatenate((searched(chain, T, rng, {2: q[2]}), q[None]))
        lost += any((apart(other, exact) > SAME).all() for other in others)
        for hint in (None, q):
            solutions = solver.inverse(T, hint)
            errors = [max(s.position_error, s.rotation_error) for s in solutions]
            assert min(errors) <= EXACT
    assert lost <= 0.02 * POSES


def test_branch_of_axes_that_almost_meet_ends_where_the_arm_is_singular() -> None:
    """Bend the elbow through its straight posture, beside which both branches lead to one."""
    chain, q = NEAR_MISS["Gen3"], np.array((0.628, -1.191, -0.111, 0.0, -0.622, -1.717, -1.494))
    solver, names, sides = kinematics_of(chain), list[str](), list[float]()
    for elbow in np.linspace(-0.3, 0.3, 60):
        q[3] = elbow
        names.append(str(solver.branch_of(q)))
        # Axis 3 sets the arm angle.
        sides.append(float(np.linalg.det(np.delete(jacobian_space(chain, q), 2, axis=1))))
    assert len(set(names)) == 2
    assert [name == names[0] for name in names] == [side * sides[0] > 0.0 for side in sides]
