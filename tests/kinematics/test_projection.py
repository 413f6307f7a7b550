"""Test the projection of a pose onto the feasible poses."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from katana450.arm.control.state.messages import PRIORITIES
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.canonical_target import PlaneOrientation
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, project
from katana450.maths.kinematics.solver import inverse
from tests.conftest import LONG
from tests.kinematics.targets import FRONT_UP, assert_on_branch, pose, targets

REACH = 0.6318


def assert_measured(chain: Chain, T: FloatArray, p: Projection, priority: Priority) -> None:
    """Check every error of `p` by independent computations."""
    np.testing.assert_array_equal(p.T, forward(chain, p.q))
    assert p.position_error == pytest.approx(
        float(np.linalg.norm(p.T[:3, 3] - T[:3, 3])), abs=1e-15
    )
    between = so3.log(p.T[:3, :3].T @ T[:3, :3])
    assert p.rotation_error == pytest.approx(float(np.linalg.norm(between)), abs=1e-12)
    normal = np.array([-math.sin(p.q[0]), math.cos(p.q[0]), 0.0])
    target_axis, axis = T[:3, 0], p.T[:3, 0]
    assert math.sin(p.yaw_error) == pytest.approx(abs(normal @ target_axis), abs=1e-12)
    assert 0.0 <= p.yaw_error <= math.pi / 2
    if priority is not Priority.POSE:
        # Their pitch may be that of a tool that faces the other way.
        return
    in_plane = target_axis - (normal @ target_axis) * normal
    cosine = (in_plane @ axis) / np.linalg.norm(in_plane)
    assert math.cos(p.pitch_error) == pytest.approx(cosine, abs=1e-9)


def test_a_feasible_pose_comes_back_unchanged(chain: Chain, rng: np.random.Generator) -> None:
    for q in rng.uniform(chain.lower, chain.upper, size=(400 if LONG else 120, 5)):
        T = forward(chain, q)
        for p in (
            project(chain, T, branch=branch_of(chain, q)),
            project(chain, T, q_hint=q),
            project(chain, T, q_hint=q, within_limits=False),
        ):
            assert p.position_error < 2e-15
            assert p.rotation_error < 1e-14
            assert p.pitch_error < 1e-13
            assert p.branch == branch_of(chain, q)
            np.testing.assert_allclose(p.q, q, atol=1e-9)
            assert p.limits == ()
            assert not p.reach


def test_a_feasible_pose_on_limits_comes_back_unchanged(
    chain: Chain, rng: np.random.Generator
) -> None:
    ends = np.stack((chain.lower, chain.upper))
    for inside in rng.uniform(chain.lower, chain.upper, size=(200 if LONG else 80, 5)):
        at_end = rng.random(5) < 0.5
        q = np.where(at_end, ends[rng.integers(2, size=5), range(5)], inside)
        p = project(chain, forward(chain, q), branch=branch_of(chain, q))
        assert p.position_error < 2e-12
        assert p.rotation_error < 1e-11
        assert chain.within_limits(p.q, slack=0.0)


@pytest.mark.parametrize("priority", PRIORITIES)
def test_errors_are_those_of_forward_kinematics(
    chain: Chain, priority: Priority, rng: np.random.Generator
) -> None:
    for T in targets(chain, rng, 10):
        for branch in (None, *BRANCHES):
            p = project(chain, T, priority=priority, branch=branch)
            assert branch in (None, p.branch)
            assert chain.within_limits(p.q, slack=0.0)
            assert_on_branch(p)
            assert_measured(chain, T, p, priority)


def test_inverse_of_the_feasible_pose_gives_its_joints(
    chain: Chain, rng: np.random.Generator
) -> None:
    for T in targets(chain, rng, 15):
        p = project(chain, T, branch=FRONT_UP)
        solutions = inverse(chain, p.T, q_hint=p.q)
        # Stretched out, joints are known to the root of rounding, but the pose is exact.
        assert min(np.abs(s.q - p.q).max() for s in solutions) < 1e-6
        assert max(s.position_error for s in solutions) < 1e-12


def test_too_near_the_shoulder_the_tool_folds_back_as_far_as_it_goes(chain: Chain) -> None:
    # An elbow that bends by at most 0.4 rad keeps the wrist farther out than the tool is long.
    lower, upper = np.array([-3.0, -3.0, -0.4, 2.0, -3.0]), np.array([3.0, 3.0, 0.3, 3.6, 3.0])
    stiff = dataclasses.replace(chain, lower=lower, upper=upper)
    hole = math.hypot(0.190 + 0.139 * math.cos(0.4), 0.139 * math.sin(0.4)) - 0.3028
    p = project(stiff, pose([0.0, 0.3, 0.0], [0.004, 0.0, 0.003]))
    assert p.position_error == pytest.approx(hole - 0.005, abs=1e-12)
    assert p.q[2] == -0.4
    assert p.limits == (2,)
    assert p.reach


def test_too_near_the_shoulder_the_forearm_folds_back_with_the_wrist_at_its_end(
    chain: Chain,
) -> None:
    # A wrist that stays bent makes forearm and tool one link, longer than the upper arm.
    lower, upper = np.array([-3.0, -3.0, 1.2, 1.7, -3.0]), np.array([3.0, 3.0, 2.2, 1.876, 3.0])
    bent = dataclasses.replace(chain, lower=lower, upper=upper)
    hole = math.hypot(0.139 + 0.3028 * math.cos(1.876), 0.3028 * math.sin(1.876)) - 0.190
    p = project(bent, pose([0.0, 0.3, 0.0], [0.04, 0.0, 0.03]), branch=FRONT_UP)
    assert p.position_error == pytest.approx(hole - 0.05, abs=1e-12)
    assert p.q[3] == 1.876
    assert p.limits == (3,)
    assert p.reach


def test_yawed_tool_loses_only_its_yaw(chain: Chain, rng: np.random.Generator) -> None:
    q = np.array([0.5, -0.9, 1.1, 0.3, 0.4])
    T = forward(chain, q)
    in_plane = np.cross([-math.sin(q[0]), math.cos(q[0]), 0.0], T[:3, 0])
    for yaw in rng.uniform(-1.4, 1.4, size=20):
        target = np.array(T)
        target[:3, :3] = so3.exp(yaw * in_plane) @ T[:3, :3]
        p = project(chain, target, branch=branch_of(chain, q))
        assert p.position_error < 2e-15
        assert p.yaw_error == pytest.approx(abs(yaw), abs=1e-13)
        assert p.rotation_error == pytest.approx(abs(yaw), abs=1e-13)
        assert p.pitch_error < 1e-12
        np.testing.assert_allclose(p.q, q, atol=1e-12)
        assert p.limits == ()


def test_beyond_reach_the_arm_stretches_towards_the_target(chain: Chain) -> None:
    direction = np.array([math.cos(0.4), 0.0, math.sin(0.4)])
    for distance in (REACH + 1e-6, 0.8, 5.0, 1e6):
        p = project(chain, pose([0.2, -0.4, 0.0], distance * direction))
        np.testing.assert_allclose(p.T[:3, 3], REACH * direction, atol=1e-9)
        assert p.position_error == pytest.approx(distance - REACH, rel=1e-9)
        np.testing.assert_allclose(p.q[1:4], [-0.4, 0.0, 0.0], atol=1e-9)
        assert p.reach
        assert p.limits == ()


@pytest.mark.parametrize("axis", range(5))
def test_limit_binds_only_within_limits(chain: Chain, axis: int) -> None:
    q = np.array([0.3, -0.8, 1.0, 0.4, 0.5])
    q[axis] = chain.upper[axis] + 0.1
    T = forward(chain, q)
    branch = branch_of(chain, q)
    free = project(chain, T, branch=branch, within_limits=False)
    assert free.position_error < 2e-15
    assert free.rotation_error < 1e-14
    np.testing.assert_allclose(free.q, q, atol=1e-12)
    assert free.limits == ()

    held = project(chain, T, branch=branch)
    assert chain.within_limits(held.q, slack=0.0)
    assert held.rotation_error > 1e-3
    assert held.limits
    for i in held.limits:
        assert held.q[i] in (chain.lower[i], chain.upper[i])
    if axis in (0, 4):
        assert held.limits == (axis,)
        assert (held.position_error > 1e-3) == (axis == 0)


def test_held_axis_1_waits_at_the_limit_the_hint_is_near(chain: Chain) -> None:
    T = pose([0.0, 0.0, 3.1], [-0.4, -0.02, 0.1])
    nearer = project(chain, T, branch=FRONT_UP)
    assert nearer.q[0] == chain.lower[0]
    for end in (chain.lower[0], chain.upper[0]):
        hint = np.array([0.8 * end, -0.8, 1.0, 0.4, 0.5])
        p = project(chain, T, branch=FRONT_UP, q_hint=hint)
        assert p.q[0] == end
        assert p.limits[0] == 0


def test_hint_decides_between_equally_near_rolls(chain: Chain) -> None:
    lower, upper = chain.lower[4], chain.upper[4]
    between = 0.5 * (lower + upper) + math.pi
    T = forward(chain, [0.3, -0.8, 1.0, 0.4, between])
    for end in (lower, upper):
        p = project(chain, T, branch=FRONT_UP, q_hint=[0.3, -0.8, 1.0, 0.4, 0.9 * end])
        assert p.q[4] == end
        assert p.limits == (4,)
        assert p.rotation_error == pytest.approx(between - upper, abs=1e-12)


def test_hint_decides_between_equal_branches(chain: Chain) -> None:
    q = np.array([0.3, -1.2, 0.9, 0.2, 0.5])
    T = forward(chain, q)
    inside = [s for s in inverse(chain, T) if s.within_limits]
    assert len(inside) >= 2
    for s in inside:
        assert project(chain, T, q_hint=s.q + 0.01).branch == s.branch


def test_tool_point_on_axis_1_takes_theta1_from_the_tool(chain: Chain) -> None:
    R = so3.rotation_z(0.7) @ so3.rotation_y(-0.9)
    p = project(chain, se3.from_rotation_translation(R, [0.0, 0.0, 0.5]))
    assert p.position_error < 2e-15
    assert p.rotation_error < 1e-14
    assert math.remainder(p.q[0] - 0.7, math.pi) == pytest.approx(0.0, abs=1e-12)
    assert chain.within_limits(p.q)


def test_tool_point_on_axis_1_may_be_reached_facing_either_way(
    chain: Chain, rng: np.random.Generator
) -> None:
    backwards = 0
    for q in rng.uniform(chain.lower, chain.upper, size=(300, 5)):
        # Lean the arm until its tool point is on axis 1.
        x, _, z = forward(chain, [0.0, *q[1:]])[:3, 3]
        q[1] -= math.atan2(x, z)
        if not chain.within_limits(q):
            continue
        T = forward(chain, q)
        T[:2, 3] = 0.0
        backwards += math.cos(q[1] + q[2] + q[3]) < 0.0
        for shoulder in ("front", "back"):
            p = project(chain, T, branch=Branch(shoulder, branch_of(chain, q).elbow))
            assert p.position_error < 2e-15
            assert p.rotation_error < 1e-13
    assert backwards > 5


def test_tool_along_axis_1_takes_theta1_from_the_hint(chain: Chain) -> None:
    T = se3.from_rotation_translation(so3.rotation_y(-math.pi / 2), [0.0, 0.0, 0.6])
    for theta1 in (0.0, -1.1):
        hint = np.array([theta1, -1.2, 0.5, 0.0, 0.0])
        p = project(chain, T, q_hint=hint)
        assert p.position_error < 2e-15
        assert p.rotation_error < 1e-7
        assert p.q[0] == theta1
    assert project(chain, T).q[0] == 0.0


@pytest.mark.parametrize("pitch", [-math.pi / 2, math.pi / 2])
def test_tool_along_axis_1_turns_axis_1_for_a_roll_beyond_its_limits(
    chain: Chain, pitch: float
) -> None:
    """Axes 1 and 5 turn about one line there, so either can replace the other."""
    height = 0.6 if pitch < 0.0 else -0.1
    for roll in np.radians(np.arange(0.0, 360.0, 7.5)):
        R = so3.rotation_y(pitch) @ so3.rotation_x(roll)
        T = se3.from_rotation_translation(R, [0.0, 0.0, height])
        for hint in (None, [0.0, -1.2, 0.5, 0.0, 0.0], [2.8, -1.2, 0.5, 0.0, 2.8]):
            p = project(chain, T, q_hint=hint)
            assert p.position_error < 2e-12
            assert p.rotation_error < 1e-9


def test_over_axis_1_roll_at_its_limit_has_a_plane_of_its_own(
    chain: Chain, rng: np.random.Generator
) -> None:
    theta1, pitch = np.meshgrid(np.linspace(-3.0, 2.8, 59), np.linspace(-math.pi, math.pi, 73))
    for end in (chain.lower[4], chain.upper[4]):
        turned = so3.rotation_x(end)
        steps = [
            so3.rotation_z(a) @ so3.rotation_y(b) @ turned
            for a, b in zip(theta1.flat, pitch.flat, strict=True)
        ]
        for R in (so3.exp(2.0 * rng.normal(size=3)) for _ in range(5)):
            orientation = PlaneOrientation.of(R)
            best = orientation.seen_from(orientation.best_turn(end))
            least = best.angle(best.best_pitch(end), end)
            assert least <= min(so3.angle(R, step) for step in steps[::3]) + 1e-9


def test_small_steps_of_the_target_are_small_steps_of_the_arm(chain: Chain) -> None:
    # A wavy path with its own yaw, in and out of reach and of the limits.
    previous = None
    hint = np.array([0.5, -0.8, 1.0, 0.4, 0.5])
    held: set[int] = set()
    reach = 0
    for t in np.linspace(0.0, math.tau, 2001):
        radius = 0.50 + 0.17 * math.sin(3.0 * t)
        azimuth, z = 1.2 * math.sin(t), 0.1 + 0.20 * math.cos(2.0 * t)
        R = so3.from_rpy(1.5 * math.sin(2.0 * t), 0.5 + 0.3 * math.sin(t), azimuth + 0.4)
        p_tool = [radius * math.cos(azimuth), radius * math.sin(azimuth), z]
        T = se3.from_rotation_translation(R, p_tool)
        p = project(chain, T, branch=FRONT_UP, q_hint=hint)
        assert p.branch == FRONT_UP
        held.update(p.limits)
        reach += p.reach
        if previous is not None:
            assert np.linalg.norm(p.T[:3, 3] - previous.T[:3, 3]) < 3e-3
            # Near the stretched arm joints move as the root of the target's motion.
            assert np.abs(p.q - previous.q).max() < 0.2
        previous, hint = p, p.q
    assert held
    assert reach


def test_every_pose_has_an_answer(chain: Chain, rng: np.random.Generator) -> None:
    sizes = (0.0, 1e-300, 1e-12, 0.1, 0.6, 1e3, 1e200)
    turns = (*so3_corners(), *(so3.exp(rng.normal(size=3)) for _ in range(4)))
    turns = turns if LONG else turns[::3]
    skew: FloatArray = rng.normal(size=3)
    directions = (*np.eye(3), *-np.eye(3), skew / np.linalg.norm(skew))
    for size, R, direction in itertools.product(sizes, turns, directions):
        T = se3.from_rotation_translation(R, size * direction)
        for branch, within in ((None, True), (FRONT_UP, True), (BRANCHES[3], False)):
            p = project(chain, T, branch=branch, within_limits=within)
            assert np.isfinite(p.T).all()
            assert np.isfinite(p.q).all()
            assert chain.within_limits(p.q, slack=0.0) or not within
            assert p.position_error < 2e-12 or within or size > REACH
            assert 0.0 <= p.rotation_error <= math.pi


def so3_corners() -> list[FloatArray]:
    """Return orientations along the axes, where two pitches, rolls or branches are equally near."""
    quarter = math.pi / 2
    return [
        so3.from_rpy(roll * quarter, pitch * quarter, yaw * quarter)
        for roll, pitch, yaw in ((0, 0, 0), (2, 0, 0), (0, 1, 0), (0, -1, 1), (1, 0, 1), (0, 2, 1))
    ]


def test_invalid_pose_and_hint_are_refused(chain: Chain) -> None:
    with pytest.raises(InputError, match="reflection"):
        project(chain, np.diag([1.0, -1.0, 1.0, 1.0]))
    with pytest.raises(InputError, match="shape"):
        project(chain, chain.M, q_hint=np.zeros(4))
    with pytest.raises(InputError, match="axis 4"):
        project(chain, chain.M, q_hint=[0.0, 0.0, 0.0, np.inf, 0.0])
