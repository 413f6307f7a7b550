"""The closed forms of four and six axes: every posture is found again, at singularities too."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from tests.general_arms import singular_postures as singular
from tests.general_arms.published_arms import FOUR, KR_6, PUMA_560, SIX, UR5E

LONG = "KATANA450_LONG" in os.environ
RANDOM = 10_000 if LONG else 200
SINGULAR = 10_000 if LONG else 90
BOTH = 1_000

POSITION = 1e-12
"""[m] The error that is allowed: 1e-9 mm."""
ROTATION = 1e-12
"""[rad]"""
ROUNDED = 2e-16
"""[rad], [m] Rounding of a pose."""

ARMS = FOUR | SIX
KINDS = {
    f"{arm}, {kind}": (chain, function(chain))
    for arms, functions in (
        (SIX, {"any": singular.determinant}),
        (FOUR, {"elbow": singular.elbow, "shoulder": singular.shoulder}),
    )
    for arm, chain in arms.items()
    for kind, function in functions.items()
}
WRISTS = {
    "UR5e": (UR5E, 4, (0.0, math.pi, -math.pi)),
    "Puma 560": (PUMA_560, 4, (0.0,)),
    "KR 6": (KR_6, 4, (0.0,)),
}

DOUBLE = {
    "UR5e stretched": (UR5E, 0.0, (0.0, math.pi)),
    "UR5e folded": (UR5E, math.pi, (0.0, math.pi)),
    "Puma 560": (PUMA_560, -math.atan2(-0.4331, -0.0203), (0.0,)),
    "KR 6": (KR_6, math.atan2(0.035, 0.42), (0.0,)),
}
"""Arms with the angle of axis 3 that stretches or folds them, and those of a wrist in line."""


def closed_form(chain: Chain) -> ClosedForm:
    kinematics = kinematics_of(chain)
    assert isinstance(kinematics, ClosedForm), kinematics.method
    return kinematics


def turned(angles: FloatArray) -> FloatArray:
    """Return angles as the nearest to 0 that differ by whole turns."""
    return angles - math.tau * np.round(angles / math.tau)


def lost(chain: Chain, q: FloatArray, solutions: FloatArray) -> float:
    """Return how far the posture ``q`` is from the nearest solution, as far as the pose tells.

    A difference that moves the tool by less than rounding, in the directions in which the arm has
    lost a freedom, is not in the pose.
    """
    _, sizes, Vt = np.linalg.svd(jacobian_space(chain, q))
    parts = np.abs(turned(solutions - q) @ Vt.T)
    parts[parts * sizes < 1e-13] = 0.0
    # These directions are tangents. Rounding hides a motion along them of ROUNDED over the singular
    # value, and the joints leave the tangent by its square.
    curved = min((ROUNDED / max(float(sizes[-1]), 1e-20)) ** 2, 1e-4)
    return float(parts.max(axis=1).min()) - curved


def check(chain: Chain, postures: FloatArray) -> None:
    """Check that each posture is among the solutions of its pose, and that these are exact."""
    solver = closed_form(chain)
    T = forward_batch(chain, postures)
    table = np.array([solver.solve(pose, q.tolist()) for pose, q in zip(T, postures, strict=True)])
    assert np.isfinite(table).all()
    distance, angle = errors_of(chain, table, T)
    for q, solutions, far, off in zip(postures, table, distance, angle, strict=True):
        exact = (far <= POSITION) & (off <= ROTATION)
        assert exact.any()
        assert lost(chain, q, solutions[exact]) <= 1e-6
        # Solutions are exact or clearly not: there is nothing between.
        assert ((far[~exact] > 1e-9) | (off[~exact] > 1e-9)).all()


@pytest.mark.parametrize("name", ARMS)
def test_every_posture_is_found_again(name: str) -> None:
    chain = ARMS[name]
    rng = np.random.default_rng(1)
    check(chain, rng.uniform(chain.lower, chain.upper, (RANDOM, chain.n)))


@pytest.mark.cases(5)
@pytest.mark.parametrize("name", KINDS)
def test_postures_at_and_near_singularities_are_found_again(name: str) -> None:
    chain, function = KINDS[name]
    check(chain, singular.near_surface(chain, function, np.random.default_rng(2), SINGULAR))


@pytest.mark.parametrize("name", WRISTS)
def test_postures_with_a_wrist_in_line_are_found_again(name: str) -> None:
    chain, joint, angles = WRISTS[name]
    rng = np.random.default_rng(3)
    check(chain, singular.aligned_wrist(chain, rng, SINGULAR, joint, angles))


@pytest.mark.parametrize("name", ARMS)
def test_branches_differ_and_are_named(name: str) -> None:
    chain = ARMS[name]
    solver = closed_form(chain)
    assert len(set(solver.branches)) == (4 if chain.n == 4 else 8)
    rng = np.random.default_rng(4)
    most = 0
    for q in rng.uniform(chain.lower, chain.upper, (40, chain.n)):
        solutions = solver.inverse(forward(chain, q))
        assert [solution.branch for solution in solutions] == list(solver.branches)
        exact = np.array([solution.q for solution in solutions if solution.exact])
        gaps = np.abs(turned(exact[:, None] - exact)).max(axis=2) + np.eye(len(exact))
        assert gaps.min() > 1e-6
        most = max(most, len(exact))
    # Four axes take a pose with one shoulder only.
    assert most == (2 if chain.n == 4 else 8)


@pytest.mark.parametrize("name", ARMS)
def test_branches_keep_their_names_along_a_motion(name: str) -> None:
    chain = ARMS[name]
    solver = closed_form(chain)
    rng = np.random.default_rng(5)
    for _ in range(20):
        a = rng.uniform(chain.lower, chain.upper)
        b = a + 1e-3 * rng.normal(size=chain.n)
        near, far = (solver.inverse(forward(chain, q)) for q in (a, b))
        for one, other in zip(near, far, strict=True):
            if one.exact and other.exact and not one.singular:
                assert np.abs(turned(one.q - other.q)).max() < 0.5


@pytest.mark.parametrize("name", ARMS)
def test_many_poses_are_solved_as_one(name: str) -> None:
    chain = ARMS[name]
    solver = closed_form(chain)
    q = np.random.default_rng(6).uniform(chain.lower, chain.upper, (50, chain.n))
    T = forward_batch(chain, q)
    single = np.array([solver.solve(pose) for pose in T])
    several = solver.inverse_batch(T)
    distance, angle = errors_of(chain, single, T)
    exact = (distance <= POSITION) & (angle <= ROTATION)
    np.testing.assert_allclose(turned(several - single)[exact], 0.0, atol=1e-9)
    assert (np.abs(errors_of(chain, several, T)[0] - distance) < 1e-6).all()


def test_many_poses_with_a_wrist_in_line_are_solved_as_one() -> None:
    q = singular.aligned_wrist(UR5E, np.random.default_rng(9), 60, 4, (0.0, math.pi))
    T = forward_batch(UR5E, q)
    solver = closed_form(UR5E)
    for table in (solver.inverse_batch(T), np.array([solver.solve(pose) for pose in T])):
        distance, angle = errors_of(UR5E, table, T)
        assert ((distance <= POSITION) & (angle <= ROTATION)).any(axis=1).all()


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", DOUBLE)
def test_stretched_or_folded_arm_with_a_wrist_in_line_is_found_again(name: str) -> None:
    """Where both are singular, no solution that counts as exact is off by more than 1e-9 mm."""
    chain, elbow, wrists = DOUBLE[name]
    rng = np.random.default_rng(10)
    q = rng.uniform(chain.lower, chain.upper, (BOTH, chain.n))
    off = 10.0 ** rng.uniform(-12.0, -1.5, (2, BOTH)) * rng.choice((-1.0, 0.0, 1.0), (2, BOTH))
    q[:, 2] = elbow + off[0]
    q[:, 4] = rng.choice(wrists, BOTH) + off[1]
    check(chain, q)


@pytest.mark.parametrize("name", ARMS)
def test_pose_out_of_reach_gets_finite_angles_that_say_so(name: str) -> None:
    chain = ARMS[name]
    solver = closed_form(chain)
    rng = np.random.default_rng(7)
    for scale in (0.0, 1e-9, 3.0, 1e3, 1e12):
        T = se3.from_rotation_translation(so3.exp(rng.normal(size=3)), scale * rng.normal(size=3))
        for solution in solver.inverse(T):
            assert np.isfinite(solution.q).all()
            reached = forward(chain, solution.q)
            assert solution.position_error == pytest.approx(math.dist(reached[:3, 3], T[:3, 3]))
            assert solution.exact == (
                solution.position_error <= 1e-9 and so3.angle(reached[:3, :3], T[:3, :3]) <= 1e-9
            )
    far = se3.from_rotation_translation(np.eye(3), np.array([3.0, 0.2, 0.1]))
    assert not any(solution.exact for solution in solver.inverse(far))


def test_singular_postures_name_the_axes_that_move_together() -> None:
    wrist = np.array([0.3, -0.9, 1.2, 0.4, 0.0, 0.6])
    solutions = closed_form(KR_6).inverse(forward(KR_6, wrist), wrist)
    nearest = min(solutions, key=lambda solution: float(np.abs(solution.q - wrist).max()))
    np.testing.assert_allclose(nearest.q, wrist, atol=1e-9)
    assert nearest.singular == (3, 5)
    regular = np.array([0.3, -0.9, 1.2, 0.4, 0.7, 0.6])
    for solution in closed_form(KR_6).inverse(forward(KR_6, regular)):
        assert not solution.exact or solution.singular == ()


def test_free_angle_is_that_of_the_hint() -> None:
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.0, 0.6])
    T = forward(UR5E, q)
    for six in (-2.0, 0.0, 0.6, 1.5):
        hint = q.copy()
        hint[5] = six
        solutions = closed_form(UR5E).inverse(T, hint)
        # Axis 6 stays where it was, and axes 2 to 4 take what is left.
        assert any(solution.exact and abs(solution.q[5] - six) < 1e-9 for solution in solutions)


def test_wrong_hint_and_wrong_poses_are_refused() -> None:
    solver = closed_form(UR5E)
    with pytest.raises(InputError, match="reflection"):
        solver.inverse(np.diag((1.0, 1.0, -1.0, 1.0)))
    with pytest.raises(InputError, match=r"shape \(5,\)"):
        solver.inverse(np.eye(4), np.zeros(5))
    with pytest.raises(InputError, match="finite angle"):
        solver.inverse(np.eye(4), np.full(6, math.nan))
    with pytest.raises(InputError, match=r"shape \(4, 4\); it must be \(N, 4, 4\)"):
        solver.inverse_batch(np.eye(4))
    with pytest.raises(InputError, match="pose 1 is not a rotation"):
        solver.inverse_batch(np.stack((np.eye(4), np.diag((1.0, 1.1, 1.0, 1.0)))))
    assert solver.inverse_batch(np.zeros((0, 4, 4))).shape == (0, 8, 6)
