from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import CHUNK, errors_of, forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse_batch import inverse_batch, validated_poses
from katana450.maths.kinematics.solver import inverse
from tests.kinematics.family import random_member


def random_q(chain: Chain, rng: np.random.Generator, n: int) -> FloatArray:
    return rng.uniform(chain.lower, chain.upper, size=(n, 5))


def assert_as_single_poses(chain: Chain, T: FloatArray, angle: float, error: float) -> None:
    """Compare angles [rad] and errors [m or rad] of every branch with those of `inverse`."""
    solutions = inverse_batch(chain, T)
    position, rotation = errors_of(chain, solutions, validated_poses(T))
    for i, pose in enumerate(T):
        for b, s in enumerate(inverse(chain, pose)):
            between = np.angle(np.exp(1j * (solutions[i, b] - s.q)))
            assert np.abs(between).max() < angle
            miss = pytest.approx(s.position_error, rel=1e-12, abs=error)
            assert position[i, b] == miss
            assert rotation[i, b] == pytest.approx(s.rotation_error, abs=error)


def test_forward_equals_that_of_single_poses(chain: Chain, rng: np.random.Generator) -> None:
    for arm in (chain, random_member(rng)[0]):
        q = random_q(arm, rng, 200)
        T = forward_batch(arm, q)
        for i in range(200):
            np.testing.assert_allclose(T[i], forward(arm, q[i]), atol=2e-15)


def test_every_solution_takes_its_pose_over_several_chunks(
    chain: Chain, rng: np.random.Generator
) -> None:
    q = random_q(chain, rng, 2 * CHUNK + 17)
    T = forward_batch(chain, q)
    solutions = inverse_batch(chain, T)
    assert solutions.shape == (len(q), 4, 5)
    position, rotation = errors_of(chain, solutions, T)
    assert position.max() < 2e-15
    assert rotation.max() < 1e-12
    original = np.abs(solutions - q[:, None]).max(axis=2).min(axis=1)
    # Near the stretched arm angles are known to the root of rounding.
    assert original.max() < 1e-6
    assert np.median(original) < 1e-14
    within = ((solutions >= chain.lower) & (solutions <= chain.upper)).all(axis=2)
    assert 2.0 < within.sum(axis=1).mean() < 2.4


def test_poses_are_solved_as_single_poses(chain: Chain, rng: np.random.Generator) -> None:
    assert_as_single_poses(chain, forward_batch(chain, random_q(chain, rng, 300)), 1e-9, 1e-14)


def test_members_of_the_family_are_solved_as_single_poses(rng: np.random.Generator) -> None:
    for _ in range(60):
        arm, _ = random_member(rng)
        assert_as_single_poses(arm, forward_batch(arm, random_q(arm, rng, 5)), 1e-6, 1e-11)


def test_hard_poses_are_solved_as_single_poses(chain: Chain, rng: np.random.Generator) -> None:
    q = random_q(chain, rng, 40)
    q[:10, 2] = 0.0
    q[10:20, 2] = math.pi
    q[20:30, 3] = math.pi / 2 - q[20:30, 1] - q[20:30, 2]
    T = forward_batch(chain, q)
    for i in range(30, 40):
        # The tool point is on axis 1.
        x, _, z = forward(chain, [0.0, *q[i, 1:]])[:3, 3]
        T[i] = forward(chain, [q[i, 0], q[i, 1] - math.atan2(x, z), *q[i, 2:]])
        T[i, :2, 3] = 0.0
    assert_as_single_poses(chain, T, 1e-7, 1e-12)


def test_infeasible_poses_have_the_errors_of_single_poses(
    chain: Chain, rng: np.random.Generator
) -> None:
    sizes = (0.0, 1e-300, 1e-9, 0.1, 1e3, 1e200)
    T = np.array(
        [
            se3.from_rotation_translation(so3.exp(rng.normal(size=3)), size * rng.normal(size=3))
            for size in sizes
            for _ in range(5)
        ]
    )
    assert_as_single_poses(chain, T, 1e-6, 1e-9)


def test_tool_perpendicular_to_the_plane_is_solved_as_single_pose(chain: Chain) -> None:
    p = [0.4, 0.0, 0.1]
    rolls = [so3.rotation_x(roll) for roll in (0.3, -2.0, 3.0)]
    T = [se3.from_rotation_translation(so3.rotation_z(0.5 * math.pi) @ R, p) for R in rolls]
    T[0][:3, 0] = 0.0, 1.0, 0.0
    assert_as_single_poses(chain, np.array(T), 1e-9, 1e-12)


def test_no_pose_depends_on_its_neighbours(chain: Chain, rng: np.random.Generator) -> None:
    T = forward_batch(chain, random_q(chain, rng, 50))
    alone = inverse_batch(chain, T)
    square = se3.from_rotation_translation(so3.rotation_z(0.5 * math.pi), [0.4, 0.0, 0.1])
    square[:3, 0] = 0.0, 1.0, 0.0
    on_axis = se3.from_rotation_translation(np.eye(3), [0.0, 0.0, 0.3])
    among = inverse_batch(chain, np.concatenate((T, [square, on_axis])))
    np.testing.assert_array_equal(among[:50], alone)


def test_single_precision_rotation_is_made_orthonormal(
    chain: Chain, rng: np.random.Generator
) -> None:
    T = forward_batch(chain, random_q(chain, rng, 20)).astype(np.float32).astype(np.float64)
    assert_as_single_poses(chain, T, 1e-6, 1e-12)


def test_empty_batch_has_no_solutions(chain: Chain) -> None:
    assert inverse_batch(chain, np.empty((0, 4, 4))).shape == (0, 4, 5)
    assert forward_batch(chain, np.empty((0, 5))).shape == (0, 4, 4)


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (lambda T: T * np.nan, "Pose 5000 has nan"),
        (lambda T: T + np.diag([0.0, 0.0, 0.0, 1e-3]), "Pose 5000 has the last row"),
        (lambda T: T @ np.diag([1.0, 1.0, 1.1, 1.0]), "rotation of pose 5000 is not a rotation"),
        (lambda T: T @ np.diag([1.0, 1.0, -1.0, 1.0]), "rotation of pose 5000 is a reflection"),
        (lambda T: T @ np.diag([1.0, 1e200, 1.0, 1.0]), "rotation of pose 5000 is not a rotation"),
        (lambda T: np.where(np.arange(16).reshape(4, 4) == 7, 1.7e308, T), "Pose 5000 is 1.7e"),
    ],
)
def test_first_invalid_pose_is_named(chain: Chain, spoilt: object, words: str) -> None:
    T = forward_batch(chain, np.zeros((6000, 5)))
    assert callable(spoilt)
    T[5000] = spoilt(T[5000])
    with pytest.raises(InputError, match=words):
        inverse_batch(chain, T)


def test_arrays_of_another_shape_or_kind_are_refused(chain: Chain) -> None:
    with pytest.raises(InputError, match=r"\(4, 4\); it must be \(N, 4, 4\)"):
        inverse_batch(chain, np.eye(4))
    with pytest.raises(InputError, match=r"it must be \(N, 5\)"):
        forward_batch(chain, np.zeros((3, 4)))
    with pytest.raises(InputError, match="complex"):
        forward_batch(chain, np.zeros((3, 5), dtype=complex))
    with pytest.raises(InputError, match="Joint vector 1 has inf for axis 3"):
        forward_batch(chain, [[0.0] * 5, [0.0, 0.0, math.inf, 0.0, 0.0]])
