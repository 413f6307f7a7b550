"""Commands of MoveIt Servo become rates of the arm, or are refused."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.errors import InputError
from katana450.extensions.rosbridge.protocol import Header, JointJog, Time, Twist, Vector3
from katana450.extensions.rosbridge.servoing import (
    LINEAR_SCALE,
    ROTATIONAL_SCALE,
    check_fresh,
    joint_rates,
    tool_rates,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.tool import pitched_frame

Q = np.array([0.6, -1.1, 1.3, 0.2, 0.4])


def given(v: np.ndarray, omega: np.ndarray) -> Twist:
    linear, angular = (Vector3(x=a, y=b, z=c) for a, b, c in (v.tolist(), omega.tolist()))
    return Twist(linear=linear, angular=angular)


def test_rates_of_a_twist_are_those_that_the_arm_can_have(arm: MountedArm) -> None:
    axes = pitched_frame(arm.chain, Q)
    v, omega = np.array([0.05, -0.1, 0.2]), 0.3 * axes[:, 1] - 0.2 * axes[:, 0]
    rates = tool_rates(given(v, omega), np.eye(3), axes)
    turning = ROTATIONAL_SCALE * np.array([0.3, -0.2])
    assert rates == pytest.approx([*(LINEAR_SCALE * v), *turning])
    # The same velocities, given in another frame.
    R = axes
    turned = tool_rates(given(R.T @ v, R.T @ omega), R, axes)
    assert turned == pytest.approx(rates)


@pytest.mark.parametrize("R", [np.eye(3), so3.exp(np.array([0.3, -0.4, 0.5]))])
def test_other_arms_take_any_rotation(R: FloatArray) -> None:
    v, omega = np.array([0.05, -0.1, 0.2]), np.array([0.3, -0.2, 0.1])
    rates = tool_rates(given(v, omega), R, None)
    assert rates == pytest.approx([*(LINEAR_SCALE * R @ v), *(ROTATIONAL_SCALE * R @ omega)])


def test_rotation_without_an_axis_is_refused_with_its_direction(arm: MountedArm) -> None:
    axes = pitched_frame(arm.chain, Q)
    for omega in (axes[:, 2], axes[:, 1] + 0.5 * axes[:, 2]):
        with pytest.raises(InputError, match="five axes of the arm cannot make"):
            tool_rates(given(np.zeros(3), omega), np.eye(3), axes)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1.01])
def test_number_out_of_range_is_refused(bad: float) -> None:
    twist = given(np.array([bad, 0.0, 0.0]), np.zeros(3))
    with pytest.raises(InputError, match=r"`linear\.x` is"):
        tool_rates(twist, np.eye(3), None)
    with pytest.raises(InputError, match="The velocity of b is"):
        joint_rates(JointJog(joint_names=["b"], velocities=[bad]), "ab")


def test_joints_that_are_not_named_stand_still() -> None:
    jog_ = JointJog(joint_names=["c", "a"], velocities=[1.0, -0.5])
    assert joint_rates(jog_, "abc") == pytest.approx([-0.25, 0.0, 0.5])


def test_old_command_is_refused_and_one_without_a_stamp_is_new() -> None:
    check_fresh(Header(), 1e9)
    check_fresh(Header(stamp=Time(sec=1_000_000_000)), 1e9 + 0.05)
    with pytest.raises(InputError, match=r"is 0\.50 s old"):
        check_fresh(Header(stamp=Time(sec=1_000_000_000)), 1e9 + 0.5)
