"""Encoders and joints are converted by the facts of the arm, both ways."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.arm import ArmModel
from katana450.errors import ConfigurationError
from katana450.extensions.real_arm.encoder_map import EncoderMap

MAP = EncoderMap()
CALIBRATED = np.array([30500, -30500, -30500, 30500, 30500, 30500])

Unit = st.floats(0.0, 1.0)


def test_calibrated_posture_is_that_of_real_arms() -> None:
    # Published for the 6M180, in the maker's convention of the axes: axes 2, 3 and 5 turn the
    # other way there.
    published = np.array([-2.96, 2.14, -2.16, -1.97, -2.93])
    signs = np.array([1, -1, -1, 1, -1])
    assert np.allclose(MAP.joints(CALIBRATED)[:5], signs * published, atol=0.006)


def test_limits_are_those_of_the_robot_description(arm: ArmModel) -> None:
    ends = np.sort([MAP.joints(MAP.lower), MAP.joints(MAP.upper)], axis=0)
    assert np.allclose(ends[0][:5], arm.chain.lower, atol=2e-4)
    assert np.allclose(ends[1][:5], arm.chain.upper, atol=2e-4)
    MAP.check_limits(arm.chain.lower, arm.chain.upper)


def test_another_arm_is_refused(arm: ArmModel) -> None:
    with pytest.raises(ConfigurationError, match="joint limits differ"):
        MAP.check_limits(arm.chain.lower - 0.02, arm.chain.upper)
    with pytest.raises(ConfigurationError, match="joint limits differ"):
        MAP.check_limits(arm.chain.lower[:4], arm.chain.upper[:4])


def test_maximum_speeds_are_those_of_the_robot_description(arm: ArmModel) -> None:
    speeds = np.abs(MAP.scale) * MAP.speed * 100.0
    assert np.allclose(speeds[:5], arm.chain.speed, rtol=1e-3)
    assert speeds[5] == pytest.approx(arm.gripper.speed, rel=1e-3)


def test_finger_follows_the_formula_of_the_motor() -> None:
    for encoder in (12240, 20000, 30770):
        degrees = -119.5 - (encoder - 31000) * 360.0 / 51200
        finger = (np.radians(degrees) - 0.21653) * -0.32543 - 0.44
        encoders = np.array([0, 0, 0, 0, 0, encoder])
        assert MAP.joints(encoders)[5] == pytest.approx(finger, abs=1e-12)


@settings(max_examples=50)
@given(st.lists(Unit, min_size=6, max_size=6))
def test_joints_return_within_half_an_encoder(fractions: list[float]) -> None:
    encoders = MAP.lower + np.array(fractions) * (MAP.upper - MAP.lower)
    joints = MAP.joints(encoders)
    sent = np.rint(MAP.encoders(joints))
    assert np.abs(sent - encoders).max() <= 0.5 + 1e-9
    assert (np.abs(MAP.joints(sent) - joints) <= (0.5 + 1e-9) * np.abs(MAP.scale)).all()
