"""Each priority keeps its part of the target, and measures the errors of the rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.state.messages import PRIORITIES
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll
from tests.kinematics.brute_force import tool_points
from tests.kinematics.targets import FRONT_UP, targets

TURNS = (-math.tau, 0.0, math.tau)


def random_pose(rng: np.random.Generator) -> FloatArray:
    R = so3.exp(rng.normal(size=3))
    return se3.from_rotation_translation(R, rng.uniform(-0.5, 0.5, size=3))


def pitch_of(T: FloatArray) -> float:
    """Return the angle of the tool's x axis below the horizontal [rad]."""
    return math.asin(max(-1.0, min(1.0, -T[2, 0])))


def pitch_distance(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))


@pytest.mark.parametrize("priority", PRIORITIES)
@pytest.mark.parametrize("branch", BRANCHES, ids=str)
def test_reported_errors_are_the_measured_ones(
    chain: Chain, priority: Priority, branch: Branch, rng: np.random.Generator
) -> None:
    for _ in range(25):
        T = random_pose(rng)
        found = project(chain, T, priority=priority, branch=branch)
        assert found.branch == branch
        assert chain.within_limits(found.q)
        reached = forward(chain, found.q)
        assert np.allclose(found.T, reached, atol=1e-12)
        assert found.position_error == pytest.approx(
            float(np.linalg.norm(reached[:3, 3] - T[:3, 3])), abs=1e-12
        )
        assert found.rotation_error == pytest.approx(so3.angle(reached[:3, :3], T[:3, :3]))


def test_pitch_is_kept_and_the_position_gives_way(chain: Chain, rng: np.random.Generator) -> None:
    gave_way = 0
    for _ in range(80):
        T = random_pose(rng)
        found = project(chain, T, priority=Priority.PITCH, branch=FRONT_UP)
        if found.pitch_error > 1e-9:
            # No posture of the branch has that pitch: the result is that of POSITION.
            other = project(chain, T, priority=Priority.POSITION, branch=FRONT_UP)
            assert np.allclose(found.q, other.q, atol=1e-12)
            continue
        assert pitch_of(found.T) == pytest.approx(pitch_of(T), abs=1e-7)
        free = project(chain, T, branch=FRONT_UP)
        assert found.position_error >= free.position_error - 1e-9
        gave_way += found.position_error > free.position_error + 1e-3
    assert gave_way > 10


def test_no_grid_point_with_the_pitch_is_nearer(
    chain: Chain, lengths: FloatArray, rng: np.random.Generator
) -> None:
    axis1, *axes = (np.array(ends) for ends in zip(chain.lower[:4], chain.upper[:4], strict=True))
    theta2, theta3 = np.meshgrid(*(np.linspace(ends[0], ends[1], 100) for ends in axes[:2]))
    angles = np.stack((np.zeros_like(theta2), theta2, theta3), axis=-1).reshape(-1, 3)
    checked = turned = 0
    for _ in range(150):
        T = se3.from_rotation_translation(so3.exp(2.0 * rng.normal(size=3)), rng.normal(size=3) / 2)
        found = project(chain, T, priority=Priority.PITCH)
        if found.pitch_error > 1e-9:
            continue
        roll, azimuth = math.atan2(T[2, 1], T[2, 2]), math.atan2(T[1, 3], T[0, 3])
        for pitch, needed in ((pitch_of(T), roll), (math.pi - pitch_of(T), roll + math.pi)):
            if not any(chain.lower[4] <= needed + turn <= chain.upper[4] for turn in TURNS):
                continue
            theta4 = pitch - angles[:, 1] - angles[:, 2]
            theta4 = (theta4 - axes[2][0]) % math.tau + axes[2][0]
            q = np.column_stack((angles, theta4))[theta4 <= axes[2][1]]
            points, _ = tool_points(lengths, q)
            for theta1 in (azimuth, azimuth + math.pi, azimuth - math.pi, *axis1):
                if axis1[0] <= theta1 <= axis1[1] and len(points):
                    away = points @ so3.rotation_z(theta1).T - T[:3, 3]
                    assert found.position_error <= np.linalg.norm(away, axis=1).min() + 1e-9
                    checked += 1
        turned += found.roll_error > 1e-3
    assert checked > 300
    assert turned > 0


def test_position_is_kept_and_the_pitch_is_the_nearest_there(
    chain: Chain, rng: np.random.Generator
) -> None:
    """Compare with every pitch that the arm can have at that point, in steps of 0.001 rad."""
    checked = 0
    for _ in range(25):
        T = random_pose(rng)
        found = project(chain, T, priority=Priority.POSITION, branch=FRONT_UP)
        if found.position_error > 1e-9:
            continue
        checked += 1
        target = ToolTarget(T[:3, 3], 0.0, 0.0)
        theta1 = float(found.q[0])
        along = T[:2, 0] @ (math.cos(theta1), math.sin(theta1))
        desired = pitch_of(T) if along >= 0.0 else math.pi - pitch_of(T)
        possible = [
            phi for phi in np.arange(-math.pi, math.pi, 1e-3) if at_pitch(chain, target, float(phi))
        ]
        least = min(pitch_distance(phi, desired) for phi in possible)
        assert found.pitch_error <= least + 1e-9
        assert found.pitch_error == pytest.approx(least, abs=2e-3)
    assert checked >= 5


def at_pitch(chain: Chain, target: ToolTarget, phi: float) -> bool:
    """Return True if the front-up arm can have its tool point at the target with that pitch."""
    l1, l2 = 0.190, 0.139
    u = float(np.hypot(*target.position[:2])) - 0.3028 * math.cos(phi)
    v = -float(target.position[2]) - 0.3028 * math.sin(phi)
    cosine = (u * u + v * v - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
    if abs(cosine) > 1.0:
        return False
    theta3 = math.acos(cosine)
    theta2 = math.atan2(v, u) - math.atan2(l2 * math.sin(theta3), l1 + l2 * math.cos(theta3))
    angles = [math.remainder(a, math.tau) for a in (theta2, theta3, phi - theta2 - theta3)]
    return bool((angles >= chain.lower[1:4]).all() and (angles <= chain.upper[1:4]).all())


@pytest.mark.parametrize("priority", [Priority.PITCH, Priority.POSITION])
def test_the_yaw_of_the_target_does_not_count(chain: Chain, priority: Priority) -> None:
    """Turned sideways by less than a right angle, POSE tilts the tool and the others do not."""
    q = np.radians([0.0, -68.0, 85.0, 8.0, 0.0])
    T = forward(chain, q)
    for yaw in np.radians([-50.0, 20.0, 70.0]):
        turned = se3.from_rotation_translation(so3.rotation_z(yaw) @ T[:3, :3], T[:3, 3])
        found = project(chain, turned, priority=priority, branch=FRONT_UP)
        assert pitch_and_roll(chain, found.q)[0] == pytest.approx(
            pitch_and_roll(chain, q)[0], abs=1e-9
        )
        assert found.position_error < 1e-12
        assert found.pitch_error < 1e-9
        assert found.yaw_error > 0.1
        tilted = project(chain, turned, priority=Priority.POSE, branch=FRONT_UP)
        assert abs(pitch_and_roll(chain, tilted.q)[0] - pitch_and_roll(chain, q)[0]) > 1e-3


def test_a_tool_target_turned_round_is_the_same_pose(chain: Chain) -> None:
    target = ToolTarget(np.array([0.2, 0.1, 0.3]), 0.7, -1.1)
    theta1 = target.facing(chain, Branch("front", "up"), 0.0)
    back = target.turned_round()
    theta1_back = target.facing(chain, Branch("back", "up"), 0.0)
    assert abs(theta1 - theta1_back) == pytest.approx(math.pi)
    assert np.allclose(target.pose(chain, theta1), back.pose(chain, theta1_back), atol=1e-12)


def test_over_axis_1_a_tool_target_stays_in_the_arms_plane(chain: Chain) -> None:
    over = ToolTarget(np.array([0.0, 0.0, 0.4]), 0.0, 0.0)
    assert over.facing(chain, FRONT_UP, 1.234) == 1.234


def test_without_a_branch_the_one_that_keeps_the_pitch_best_is_taken(
    chain: Chain, rng: np.random.Generator
) -> None:
    """The pitch comes before the roll and the yaw, even if another branch has these nearer."""
    for T in targets(chain, rng, 15):
        p = project(chain, T, priority=Priority.POSITION)
        each = [project(chain, T, priority=Priority.POSITION, branch=branch) for branch in BRANCHES]
        nearest = min(e.position_error for e in each) + 1e-9
        assert p.position_error <= nearest
        pitches = [e.pitch_error for e in each if e.position_error <= nearest]
        assert p.pitch_error <= min(pitches) + 1e-8
