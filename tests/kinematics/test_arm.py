from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from app.errors import RobotDescriptionError
from app.geometry import screws, se3, so3
from app.geometry.arrays import FloatArray
from app.kinematics.arm import arm_of
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.inverse import inverse


def test_lengths_are_read_off_the_chain(chain: Chain, lengths: FloatArray) -> None:
    arm = arm_of(chain)
    np.testing.assert_allclose([arm.l1, arm.l2, arm.l3], lengths, atol=1e-16)
    assert arm_of(chain) is arm


def _with_axis(chain: Chain, i: int, direction: list[float], point: list[float]) -> Chain:
    S = np.array(chain.S)
    S[:, i] = screws.revolute(direction, point)
    return dataclasses.replace(chain, S=S)


def test_other_arms_are_refused_with_the_axis_and_the_amount(chain: Chain) -> None:
    x, y, z = np.eye(3).tolist()
    origin, elbow, wrist = [0.0] * 3, [0.19, 0.0, 0.0], [0.329, 0.0, 0.0]
    tilt = [0.0, 1.0, 1e-3]
    cases = [
        (_with_axis(chain, 0, z, [0.0, 0.02, 0.0]), r"axis 1 .* by 0.02 m"),
        (_with_axis(chain, 0, y, origin), r"axis 1 must point along \+z"),
        (_with_axis(chain, 1, y, [0.02, 0.0, 0.0]), r"axis 2 must cross axis 1 .* 0.02 m"),
        (_with_axis(chain, 2, tilt, elbow), r"axis 3 must point along \+y .* 0.001 rad"),
        (_with_axis(chain, 2, y, [0.19, 0.0, 0.03]), r"axis 3 must be level .* 0.03 m"),
        (_with_axis(chain, 3, y, [0.329, 0.0, -0.01]), r"axis 4 must be level .* -0.01 m"),
        (_with_axis(chain, 3, y, elbow), r"wrist must lie farther"),
        (_with_axis(chain, 4, x, [0.0, 0.0, 0.005]), r"axis 5 must cross axis 4 .* 0.005 m"),
        (_with_axis(chain, 4, z, wrist), r"axis 5 must point along \+x"),
        (chain.with_tool(se3.from_rotation_translation(np.eye(3), [0.6, 0.01, 0.0])), "0.01 m"),
        (chain.with_tool(se3.from_rotation_translation(np.eye(3), [0.3, 0.0, 0.0])), "tool point"),
        (
            chain.with_tool(se3.from_rotation_translation(so3.rotation_y(0.1), [0.6, 0.0, 0.0])),
            "x axis",
        ),
        (dataclasses.replace(chain, lower=np.array([-3.0, -2.0, 0.1, -2.0, -2.0])), "axis 3"),
    ]
    for other, words in cases:
        with pytest.raises(RobotDescriptionError, match=words):
            arm_of(other)


def test_an_arm_of_four_joints_is_refused(chain: Chain) -> None:
    four = Chain(
        chain.M, chain.S[:, :4], chain.lower[:4], chain.upper[:4], chain.speed[:4], chain.names[:4]
    )
    with pytest.raises(RobotDescriptionError, match="five joints; this arm has 4"):
        inverse(four, np.eye(4))


def test_a_tool_rolled_at_home_is_covered(chain: Chain) -> None:
    rolled = chain.with_tool(chain.M @ se3.from_rotation_translation(so3.rotation_x(0.7), [0] * 3))
    q = np.array([0.3, -0.8, 1.0, 0.4, 0.5])
    solutions = inverse(rolled, forward(rolled, q))
    np.testing.assert_allclose(solutions[0].q, q, atol=1e-13)
