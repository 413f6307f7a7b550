"""Speeds, singularities, and jogging through them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.maths.kinematics.velocity import (
    WELL_CONDITIONED,
    JogFrame,
    characteristic_length,
    jog,
    limit_distances,
    singular_values,
    tool_speed,
)
from tests.kinematics.family import random_member

READY = np.radians([0.0, -68.0, 85.0, 8.0, 0.0])
DT = 0.01
H = 1e-6


def finite_twist(chain: Chain, q: FloatArray, qd: FloatArray) -> FloatArray:
    """Return the twist of the tool point in the axes of {S} by central differences."""
    after, behind = forward(chain, q + H * qd), forward(chain, q - H * qd)
    omega = so3.log(after[:3, :3] @ behind[:3, :3].T) / (2.0 * H)
    return np.concatenate((omega, (after[:3, 3] - behind[:3, 3]) / (2.0 * H)))


def postures(chain: Chain, rng: np.random.Generator, number: int) -> FloatArray:
    return rng.uniform(chain.lower, chain.upper, size=(number, 5))


def test_characteristic_length_is_the_root_mean_square_of_the_distances(chain: Chain) -> None:
    arms = [0.6318, 0.6318, 0.4418, 0.3028, 0.0]
    assert characteristic_length(chain) == pytest.approx(math.sqrt(np.mean(np.square(arms))))


def test_singular_values_against_finite_differences(chain: Chain, rng: np.random.Generator) -> None:
    scale = np.array([1.0] * 3 + [1.0 / characteristic_length(chain)] * 3)
    for q in postures(chain, rng, 20):
        J = np.column_stack([scale * finite_twist(chain, q, qd) for qd in np.eye(5)])
        expected = np.linalg.svd(J, compute_uv=False)
        assert singular_values(chain, q) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(
    "q",
    [
        np.zeros(5),
        np.array([0.3, -0.8, 0.0, 0.7, 0.2]),
    ],
    ids=["stretched", "elbow straight"],
)
def test_in_a_singularity_the_smallest_singular_value_is_zero(chain: Chain, q: FloatArray) -> None:
    assert singular_values(chain, q)[-1] < 1e-12


def test_limit_distances(chain: Chain) -> None:
    q = np.array(READY)
    q[1] = chain.upper[1] - 0.127
    q[3] = chain.lower[3] - 0.01
    distances = limit_distances(chain, q)
    assert distances[1] == pytest.approx(0.127)
    assert distances[3] == pytest.approx(-0.01)
    assert int(distances.argmin()) == 3


@pytest.mark.parametrize("frame", JogFrame)
def test_jog_follows_its_direction_and_keeps_pitch_and_roll(
    chain: Chain, frame: JogFrame, rng: np.random.Generator
) -> None:
    """A slow jog well inside follows the tool point and the two feasible rotations exactly."""
    checked = 0
    for q in postures(chain, rng, 100):
        R, p = forward(chain, q)[:3, :3], forward(chain, q)[:3, 3]
        # Over axis 1 no joint moves the tool point sideways.
        well = min(singular_values(chain, q)[-1], float(np.hypot(*p[:2])) / 2.0)
        if well < 2 * WELL_CONDITIONED or min(limit_distances(chain, q)) < 0.1:
            continue
        V = rng.normal(scale=0.01, size=6)
        qd = jog(chain, q, V, frame, DT)
        twist = finite_twist(chain, q, qd)
        omega, v = (R @ V[:3], R @ V[3:]) if frame is JogFrame.TOOL else (V[:3], V[3:])
        side = np.array([-math.sin(q[0]), math.cos(q[0]), 0.0])
        assert np.allclose(twist[3:], v, atol=1e-7)
        assert twist[:3] @ side == pytest.approx(omega @ side, abs=1e-7)
        assert twist[:3] @ R[:, 0] == pytest.approx(omega @ R[:, 0], abs=1e-7)
        checked += 1
    assert checked > 10


def test_fast_jog_is_slowed_in_all_joints(chain: Chain) -> None:
    V = np.array([0.0, 0.0, 0.0, 0.0, 0.05, 0.02])
    slow = jog(chain, READY, V, JogFrame.BASE, DT)
    fast = jog(chain, READY, 100.0 * V, JogFrame.BASE, DT)
    assert (np.abs(fast) / chain.speed).max() == pytest.approx(1.0)
    assert np.allclose(fast / np.linalg.norm(fast), slow / np.linalg.norm(slow), atol=1e-9)


def test_at_a_limit_the_other_joints_continue(chain: Chain) -> None:
    q = np.array(READY)
    q[4] = chain.upper[4]
    V = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.05])
    qd = jog(chain, q, V, JogFrame.TOOL, DT)
    assert qd[4] == 0.0
    assert np.abs(qd[1:4]).max() > 0.01
    assert jog(chain, q, -V, JogFrame.TOOL, DT)[4] < 0.0


def test_jogging_for_long_stays_inside_limits_and_speeds(
    chain: Chain, rng: np.random.Generator
) -> None:
    """Jog from everywhere in every direction until something stops it, also past singularities."""
    singular = 0
    for q in postures(chain, rng, 12):
        V = np.concatenate((rng.normal(size=3), rng.normal(scale=0.5, size=3)))
        place = np.array(q)
        for _ in range(60):
            qd = jog(chain, place, V, JogFrame.BASE, 0.05)
            assert np.isfinite(qd).all()
            assert (np.abs(qd) <= chain.speed * (1 + 1e-12)).all()
            place = place + 0.05 * qd
            assert chain.within_limits(place)
            singular += singular_values(chain, place)[-1] < WELL_CONDITIONED
    assert singular > 50


@pytest.mark.parametrize("V", [*np.eye(6), np.zeros(6), np.full(6, 1e9)], ids=str)
def test_in_a_singularity_a_jog_is_bounded(chain: Chain, V: FloatArray) -> None:
    for q in (np.zeros(5), np.array([0.0, -0.8, 0.0, 0.0, 0.0]), READY * 0.0 + chain.upper):
        qd = jog(chain, q, V, JogFrame.TOOL, DT)
        assert np.isfinite(qd).all()
        assert (np.abs(qd) <= chain.speed * (1 + 1e-12)).all()
    # There is no motion along the lost direction, and no large rates in other joints.
    assert np.allclose(jog(chain, np.zeros(5), np.eye(6)[3], JogFrame.BASE, DT), 0.0, atol=1e-9)


def test_damping_bounds_the_rates_of_a_small_target(chain: Chain) -> None:
    """Move towards the stretched arm, without speed limits."""
    V = np.array([0.0, 0.0, 0.0, 1e-4, 0.0, 0.0])
    bound = 1.21 / WELL_CONDITIONED * 1e-4 / characteristic_length(chain)
    for bend in np.geomspace(1e-12, 0.3, 40):
        q = np.array([0.0, -0.5 * bend, bend, -0.5 * bend, 0.0])
        assert np.linalg.norm(jog(chain, q, V, JogFrame.BASE, DT)) <= bound


def test_a_joint_beyond_its_limit_may_only_come_back(chain: Chain) -> None:
    q = np.array(READY)
    q[3] = chain.upper[3] + 0.02
    for V in (np.eye(6)[1], -np.eye(6)[1]):
        assert jog(chain, q, 0.1 * V, JogFrame.TOOL, DT)[3] <= 0.0


@pytest.mark.parametrize(
    ("q", "V", "dt", "message"),
    [
        (READY, np.zeros(5), DT, "twist"),
        (READY, np.full(6, math.nan), DT, "twist"),
        (np.full(5, math.nan), np.zeros(6), DT, "axis 1"),
        (READY, np.zeros(6), 0.0, "above 0"),
        (READY, np.zeros(6), math.inf, "above 0"),
    ],
)
def test_invalid_jog_is_refused(
    chain: Chain, q: FloatArray, V: FloatArray, dt: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        jog(chain, q, V, JogFrame.BASE, dt)


def test_twists_are_of_the_tool_point(chain: Chain) -> None:
    """A turn in tool axes leaves the point in place."""
    qd = jog(chain, READY, np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0]), JogFrame.TOOL, DT)
    moved = forward(chain, READY + 1e-4 * qd)
    still = forward(chain, READY)
    assert np.allclose(moved[:3, 3], still[:3, 3], atol=1e-8)
    turned = se3.inverse(still) @ moved
    assert so3.log(turned[:3, :3]) == pytest.approx([0.0, 1e-5, 0.0], abs=1e-8)


def test_the_tool_speed_is_that_of_the_jacobian(rng: np.random.Generator) -> None:
    for _ in range(60):
        chain, _ = random_member(rng)
        q, qd = rng.uniform(-2.5, 2.5, 5), rng.normal(size=5)
        exact = float(np.linalg.norm(jacobian_body(chain, q)[3:] @ qd))
        speed = tool_speed(chain, q, qd)
        assert speed >= exact - 1e-12
        off = arm_of(chain).off_axis
        assert speed <= exact + 2.0 * off * np.abs(qd).sum() + 1e-12
        on_axis = chain.with_tool(_on_roll_axis(chain))
        exact = float(np.linalg.norm(jacobian_body(on_axis, q)[3:] @ qd))
        assert tool_speed(on_axis, q, qd) == pytest.approx(exact, abs=1e-12)


def _on_roll_axis(chain: Chain) -> FloatArray:
    """Return the tool frame moved to the foot of its point on the roll axis."""
    M = np.array(chain.M)
    axis, point = chain.S[:3, 4], screws.point_on(chain.S[:, 4])
    M[:3, 3] = point + axis * (axis @ (M[:3, 3] - point))
    return M
