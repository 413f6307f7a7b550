"""Each priority keeps its part of the target, and measures the errors of the rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll
from tests.kinematics.targets import FRONT_UP


def random_pose(rng: np.random.Generator) -> FloatArray:
    R = so3.exp(rng.normal(size=3))
    return se3.from_rotation_translation(R, rng.uniform(-0.5, 0.5, size=3))


def pitch_of(T: FloatArray) -> float:
    """Return the angle of the tool's x axis below the horizontal [rad]."""
    return math.asin(max(-1.0, min(1.0, -T[2, 0])))


def test_pitch_is_kept_and_the_position_gives_way(chain: Chain, rng: np.random.Generator) -> None:
    gave_way = 0
    for _ in range(80):
        T = random_pose(rng)
        p = project(chain, T, priority=Priority.PITCH, branch=FRONT_UP)
        if p.pitch_error > 1e-9:
            # No posture of the branch has that pitch: the result is that of POSITION.
            other = project(chain, T, priority=Priority.POSITION, branch=FRONT_UP)
            assert np.allclose(p.q, other.q, atol=1e-12)
            continue
        assert pitch_of(p.T) == pytest.approx(pitch_of(T), abs=1e-7)
        free = project(chain, T, branch=FRONT_UP)
        assert p.position_error >= free.position_error - 1e-9
        gave_way += p.position_error > free.position_error + 1e-3
    assert gave_way > 10


@pytest.mark.parametrize("priority", [Priority.PITCH, Priority.POSITION])
def test_the_yaw_of_the_target_does_not_count(chain: Chain, priority: Priority) -> None:
    """Turned sideways by less than a right angle, POSE tilts the tool and the others do not."""
    q = np.radians([0.0, -68.0, 85.0, 8.0, 0.0])
    T = forward(chain, q)
    for yaw in np.radians([-50.0, 20.0, 70.0]):
        turned = se3.from_rotation_translation(so3.rotation_z(yaw) @ T[:3, :3], T[:3, 3])
        p = project(chain, turned, priority=priority, branch=FRONT_UP)
        assert pitch_and_roll(chain, p.q)[0] == pytest.approx(pitch_and_roll(chain, q)[0], abs=1e-9)
        assert p.position_error < 1e-12
        assert p.pitch_error < 1e-9
        assert p.yaw_error > 0.1
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
