from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.errors import RobotDescriptionError
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.solver import inverse
from tests.kinematics.family import random_member


def test_lengths_follow_from_the_chain(chain: Chain, lengths: FloatArray) -> None:
    arm = arm_of(chain)
    np.testing.assert_allclose([arm.l1, arm.l2, arm.l3], lengths, atol=1e-16)
    assert arm_of(chain) is arm


def _with_axis(chain: Chain, i: int, direction: list[float], point: list[float]) -> Chain:
    S = np.array(chain.S)
    S[:, i] = screws.revolute(direction, point)
    return dataclasses.replace(chain, S=S)


def test_arm_outside_the_family_is_refused_with_axis_amount_and_condition(chain: Chain) -> None:
    _, y, z = np.eye(3).tolist()
    elbow, wrist = [0.19, 0.0, 0.0], [0.329, 0.0, 0.0]
    tilt = [0.0, 1.0, 1e-3]
    cases = [
        (
            _with_axis(chain, 0, y, [0.0] * 3),
            r"axis 2 must be perpendicular to axis 1 and is 90 deg off",
        ),
        (_with_axis(chain, 0, tilt, [0.0] * 3), r"axis 2 must be perpendicular to axis 1"),
        (_with_axis(chain, 2, tilt, elbow), r"axis 3 must be parallel to axis 2 .* 0\.0573 deg"),
        (_with_axis(chain, 3, z, wrist), r"axis 4 must be parallel to axis 2 .* 90 deg"),
        (_with_axis(chain, 4, y, wrist), r"axis 5 must be perpendicular to axis 4 .* 90 deg"),
        (_with_axis(chain, 2, y, [0.0, 0.3, 0.0]), r"axes 2 and 3 are 0 mm apart"),
        (_with_axis(chain, 3, y, elbow), r"axes 3 and 4 are 0 mm apart"),
        (chain.with_tool(se3.from_rotation_translation(np.eye(3), wrist)), r"axis 4 and the tool"),
    ]
    for other, words in cases:
        with pytest.raises(RobotDescriptionError, match=words):
            arm_of(other)


def test_all_faults_are_named_in_one_error(chain: Chain) -> None:
    wrong = _with_axis(chain, 2, [0.0, 1.0, 0.1], [0.19, 0.0, 0.0])
    wrong = _with_axis(wrong, 4, [1.0, 0.2, 0.0], [0.4, 0.0, 0.0])
    with pytest.raises(
        RobotDescriptionError, match=r"axis 3 .* 5\.71 deg off; axis 5 .* 11\.3 deg"
    ):
        arm_of(wrong)


def test_rounding_in_a_file_is_accepted(chain: Chain) -> None:
    rounded = _with_axis(chain, 2, [0.0, 1.0, 3.7e-6], [0.19, 0.0, 0.0])
    rounded = rounded.with_tool(
        chain.M + np.array([[0.0] * 4, [0, 0, 0, 8e-6], [0.0] * 4, [0] * 4])
    )
    arm = arm_of(rounded)
    assert arm.skew == pytest.approx(3.7e-6)
    assert arm.gap == pytest.approx(8e-6)
    T = forward(rounded, [0.3, -0.8, 1.0, 0.4, 0.5])
    for s in inverse(rounded, T):
        assert 1e-9 < s.position_error < 2e-5
        assert s.rotation_error < 1e-4


def test_offsets_follow_from_any_member(rng: np.random.Generator) -> None:
    for _ in range(200):
        chain, offsets = random_member(rng)
        arm = arm_of(chain)
        l1, l2, l3 = offsets.links
        assert [arm.l1, arm.l2] == pytest.approx([l1, l2], abs=1e-14)
        assert arm.l3 == pytest.approx(math.hypot(l3, offsets.roll_offset), abs=1e-14)
        assert abs(arm.a) == pytest.approx(abs(offsets.radial), abs=1e-14)
        assert abs(arm.d) == pytest.approx(abs(offsets.lateral), abs=1e-14)
        assert math.tan(abs(arm.tilt)) == pytest.approx(abs(offsets.roll_offset) / l3, abs=1e-13)
        assert arm.off_axis < 1e-14


def test_the_canonical_arm_moves_as_the_chain_does(rng: np.random.Generator) -> None:
    for _ in range(200):
        chain, _ = random_member(rng)
        arm = arm_of(chain)
        q = rng.uniform(chain.lower, chain.upper)
        one, two, three, four, five = arm.canonical(q).tolist()
        phi = two + three + four
        u = arm.a + arm.l1 * math.cos(two) + arm.l2 * math.cos(two + three) + arm.l3 * math.cos(phi)
        v = arm.l1 * math.sin(two) + arm.l2 * math.sin(two + three) + arm.l3 * math.sin(phi)
        R = so3.rotation_z(one)
        T_C_K = se3.from_rotation_translation(
            R @ so3.rotation_y(phi - arm.tilt) @ so3.rotation_x(five), R @ [u, arm.d, -v]
        )
        T = se3.inverse(arm.T_C_S) @ T_C_K @ arm.T_K_tool
        np.testing.assert_allclose(T, forward(chain, q), atol=3e-15)
        np.testing.assert_allclose(arm.joints(arm.canonical(q)), q, atol=1e-15)


def test_an_arm_of_four_joints_is_refused(chain: Chain) -> None:
    four = Chain(
        chain.M, chain.S[:, :4], chain.lower[:4], chain.upper[:4], chain.speed[:4], chain.names[:4]
    )
    with pytest.raises(RobotDescriptionError, match="five joints that turn; this arm has 4"):
        inverse(four, np.eye(4))


def test_a_tool_rolled_at_home_is_covered(chain: Chain) -> None:
    rolled = chain.with_tool(chain.M @ se3.from_rotation_translation(so3.rotation_x(0.7), [0] * 3))
    q = np.array([0.3, -0.8, 1.0, 0.4, 0.5])
    solutions = inverse(rolled, forward(rolled, q))
    np.testing.assert_allclose(solutions[0].q, q, atol=1e-13)
