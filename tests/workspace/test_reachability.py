"""Tests of the count of orientations, against forward kinematics and against the projection."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.extensions.reachability.reachability import Reachability
from katana450.maths.geometry import screws
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, joint_frames
from tests.workspace.base_frame import in_base


def reachability(
    arm: MountedArm, *, tool: str = "tcp", table: float = 0.0, pitches: int = 8, rolls: int = 6
) -> Reachability:
    chain = arm.chain_to(tool or arm.default_tool)
    return Reachability(chain, arm.T_base_shoulder, table, pitches, rolls)


def postures_inside(chain: Chain, count: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, chain.n))


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.0, 0.02), (0.03, -0.01)])
def test_orientations_from_forward_kinematics_are_counted(
    arm: MountedArm, offset: tuple[float, float]
) -> None:
    """Postures inside the limits with the tool level and unrolled: this orientation counts.

    ``offset`` is the offset of the tool point from the roll axis, sideways and up [m].
    """
    M = np.array(arm.chain.M)
    M[1:3, 3] += offset
    level = Reachability(arm.chain.with_tool(M), arm.T_base_shoulder, -1.0, 1, 1)
    chain = level.chain
    q = postures_inside(chain, 600, 4)
    q[:, 3] = -q[:, 1] - q[:, 2]
    q[:, 4] = 0.0
    q = q[(q[:, 3] >= chain.lower[3]) & (q[:, 3] <= chain.upper[3])]
    T = np.array([forward(chain, posture) for posture in q])
    # With its back to the point, the arm has the tool inward, at pitch pi and not 0.
    outward = (T[:, :2, 0] * T[:, :2, 3]).sum(axis=1) > 0.0
    assert outward.sum() > 20
    assert (level.count(in_base(level, T[outward, :3, 3])) == 1).all()


def test_a_point_on_axis_1_can_be_counted(arm: MountedArm) -> None:
    every = reachability(arm)
    above = np.array([[0.0, 0.0, 0.8], [1e-12, 0.0, 0.8]])
    counts = every.count(above)
    assert counts[0] > 0
    assert counts[0] == counts[1]


def test_points_below_the_table_or_out_of_reach_are_not_counted(arm: MountedArm) -> None:
    point = np.array([[0.3, 0.1, 0.3]])
    assert reachability(arm, table=0.29).count(point)[0] > 0
    assert reachability(arm, table=0.31).count(point)[0] == 0
    assert reachability(arm).count(np.array([[2.0, 0.0, 0.3], [0.0, 0.0, -1.0]])).tolist() == [
        0,
        0,
    ]
    assert reachability(arm).count(np.empty((0, 3))).shape == (0,)


def test_elbow_and_wrist_stay_above_the_table(arm: MountedArm) -> None:
    """Compare with each link moved from home: both points must not be below the table."""
    chain = arm.chain
    q = postures_inside(chain, 300, 11)
    points = [screws.point_on(S) for S in chain.S.T]
    frames = np.array([joint_frames(chain, posture) for posture in q])
    heights = np.stack(
        [
            (frames[:, 1] @ [*points[2], 1.0])[:, 2],
            (frames[:, 2] @ [*points[3], 1.0])[:, 2],
        ]
    )
    shoulder = arm.T_base_shoulder[2, 3]
    for table in (0.1, 0.3, 0.4):
        clear = reachability(arm, table=table).clear(q)
        assert np.array_equal(clear, (heights + shoulder >= table).all(axis=0))
        assert 0 < clear.sum() < len(q) or table == 0.1


def test_rolls_are_those_that_axis_5_can_turn(arm: MountedArm) -> None:
    """Axis 5 turns from -164.5 to 171.5 deg, and only the front shoulder is inside the limits."""
    whole_degrees = reachability(arm, pitches=1, rolls=360)
    p = forward(whole_degrees.chain, np.array([0.0, -0.8, 1.2, -0.4, 0.0]))[None, :3, 3]
    assert whole_degrees.count(in_base(whole_degrees, p)).tolist() == [336]


def test_every_limit_counts(arm: MountedArm) -> None:
    """The limits of each joint reduce the orientations, and wider limits restore them."""
    chain = arm.chain
    points = np.random.default_rng(5).uniform([-0.4, -0.4, 0.1], [0.4, 0.4, 0.6], (25, 3))

    def total(lower: FloatArray, upper: FloatArray) -> int:
        limited = dataclasses.replace(chain, lower=lower, upper=upper)
        every = Reachability(limited, arm.T_base_shoulder, 0.0, 6, 6)
        return int(every.count(points).sum())

    whole = total(chain.lower, chain.upper)
    for joint in range(5):
        narrow_lower, narrow_upper = chain.lower.copy(), chain.upper.copy()
        narrow_lower[joint] *= 0.5
        narrow_upper[joint] *= 0.5
        assert total(narrow_lower, narrow_upper) < whole
