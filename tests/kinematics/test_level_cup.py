"""A level cup with a target yaw of 0 all round the arm stays level; the position gives way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, project
from katana450.maths.kinematics.tool import pitch_and_roll
from tests.conftest import LONG
from tests.kinematics.family import limited_member, random_pose

LEVEL = 1e-6
"""Tolerance of the level [rad]."""

FRONT = tuple(branch for branch in BRANCHES if branch.shoulder == "front")

COUNT = 2_000 if LONG else 400


def ring(rng: np.random.Generator, count: int, reach: float) -> FloatArray:
    """Return points (count, 3) [m] evenly all round axis 1, also straight behind the arm."""
    azimuth = np.linspace(-math.pi, math.pi, count)
    radius = rng.uniform(0.05, reach, count)
    height = rng.uniform(-0.6, 0.9, count) * reach
    return np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth), height), axis=1)


def tilt(T: FloatArray) -> float:
    """Return the angle [rad] between the tool's z axis and the vertical."""
    return math.atan2(math.hypot(T[0, 2], T[1, 2]), T[2, 2])


def level(chain: Chain, point: FloatArray, yaw: float = 0.0) -> Projection:
    T = se3.from_rotation_translation(so3.rotation_z(yaw), point)
    return project(chain, T, priority=Priority.PITCH)


@pytest.mark.cases(1)
@pytest.mark.parametrize("branch", [None, *FRONT], ids=str)
def test_level_cup_stays_level_all_round_the_arm(
    chain: Chain, branch: Branch | None, rng: np.random.Generator
) -> None:
    gave_way = 0
    for point in ring(rng, COUNT, 0.7):
        T = se3.from_rotation_translation(np.eye(3), point)
        p = project(chain, T, priority=Priority.PITCH, branch=branch)
        assert tilt(p.T) <= LEVEL, point
        assert p.pitch_error <= LEVEL
        gave_way += p.position_error > 1e-6
    assert COUNT / 2 < gave_way < COUNT


def test_level_cup_behind_the_arm_arrives_where_a_level_posture_exists(chain: Chain) -> None:
    azimuth = math.radians(-160.0)
    point = np.array((0.3 * math.cos(azimuth), 0.3 * math.sin(azimuth), 0.25))
    facing = level(chain, point, yaw=azimuth)
    assert facing.position_error < 1e-9
    p = level(chain, point)
    np.testing.assert_allclose(p.q, facing.q, atol=1e-9)
    assert tilt(p.T) <= LEVEL


def test_yaw_does_not_move_a_level_cup(chain: Chain, rng: np.random.Generator) -> None:
    for point in ring(rng, 40, 0.6):
        expected = level(chain, point, yaw=math.atan2(point[1], point[0]))
        for yaw in rng.uniform(-math.pi, math.pi, 4):
            p = level(chain, point, yaw=float(yaw))
            assert p.position_error == pytest.approx(expected.position_error, abs=1e-9)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(6))
def test_pitch_and_roll_are_kept_wherever_a_member_has_them(seed: int) -> None:
    """Test arms with offsets and with the tool point beside the roll axis, on every branch."""
    rng = np.random.default_rng(seed)
    chain = limited_member(rng, lateral=seed % 2 == 1)
    if seed >= 4:
        chain = chain.with_tool(chain.M @ random_pose(rng, 0.02))
    arm = arm_of(chain)
    possible = {branch: level_postures(chain, branch, rng) for branch in BRANCHES}
    checked = 0
    for point in ring(rng, COUNT // 20, arm.reach):
        T_C = se3.from_rotation_translation(np.eye(3), point)
        T = se3.inverse(arm.T_C_S) @ T_C @ arm.T_K_tool
        for branch in BRANCHES:
            p = project(chain, T, priority=Priority.PITCH, branch=branch)
            pitch, _ = pitch_and_roll(chain, p.q)
            slope = abs(math.sin(pitch))
            if any(possible[branch]):
                assert slope <= LEVEL
                assert p.pitch_error <= LEVEL
                checked += 1
            if p.position_error > 1e-6 and all(possible[branch]):
                # The two rolls differ by half a turn, so one of them is inside most limits.
                rolls = [arm.joints((0.0, 0.0, 0.0, 0.0, psi))[4] for psi in (0.0, math.pi)]
                if any(fits(chain, roll) for roll in rolls):
                    assert p.roll_error <= LEVEL
    assert checked > 0


def fits(chain: Chain, roll: float) -> bool:
    turned = roll + math.tau * np.array((-1.0, 0.0, 1.0))
    return bool(((turned >= chain.lower[4]) & (turned <= chain.upper[4])).any())


def level_postures(chain: Chain, branch: Branch, rng: np.random.Generator) -> tuple[bool, bool]:
    """Return True for outward and for inward level postures that a random search finds."""
    arm = arm_of(chain)
    alpha = arm.canonical(rng.uniform(chain.lower, chain.upper, size=(20_000, 5)))
    lower, upper = np.sort((arm.canonical(chain.lower), arm.canonical(chain.upper)), axis=0)
    middle = 0.5 * (lower + upper)[3]
    possible = []
    for pitch in (0.0, math.pi):
        four = pitch + arm.tilt - alpha[:, 1] - alpha[:, 2] - middle
        alpha[:, 3] = middle + (four + math.pi) % math.tau - math.pi
        points = forward_batch(chain, arm.joints(alpha))[:, :3, 3]
        x, y, _ = arm.T_C_S[:3, :3] @ points.T + arm.T_C_S[:3, 3:]
        r = x * np.cos(alpha[:, 0]) + y * np.sin(alpha[:, 0])
        inside = (alpha[:, 3] >= lower[3]) & (alpha[:, 3] <= upper[3])
        inside &= (r > 1e-3) if branch.shoulder == "front" else (r < -1e-3)
        inside &= (np.sin(alpha[:, 2]) >= 0.0) == (branch.elbow == "up")
        possible.append(bool(inside.any()))
    return possible[0], possible[1]
