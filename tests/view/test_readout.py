"""The read-out shows the pose of the tool in the chosen frame."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.session.session import Session
from katana450.arm.robot.arm_reader import MountedArm
from katana450.maths.kinematics.forward import forward
from katana450.server.view.controls import ends
from katana450.server.view.readout import BASE, SHOULDER, PoseDisplay, page


@pytest.mark.parametrize(
    ("frame", "z", "heading"), [(SHOULDER, "7.6", "tcp in {S}"), (BASE, "282.1", "tcp in base")]
)
def test_tool_pose_is_shown_in_the_chosen_frame(
    arm: MountedArm, session: Session, frame: str, z: str, heading: str
) -> None:
    display = PoseDisplay(frame, arm.T_base_shoulder)
    text = page(arm, session.begin(session.ready, 0.0, 0.0), display)
    assert f"<th>{heading}</th>" in text
    for place in ("now", "goal"):
        assert f"<td data-{place}='x'>478.5</td>" in text
        assert f"<td data-{place}='z'>{z}</td>" in text
        assert f"<td data-{place}='pitch'>25.0</td>" in text
    for unit in ("mm", "°"):
        assert text.count(f"<td class='unit'>{unit}</td>") == 3


@pytest.mark.parametrize("frame", [BASE, SHOULDER])
def test_numbers_of_a_pose_give_it_back(arm: MountedArm, frame: str) -> None:
    T = forward(arm.chain, np.array([0.4, -1.0, 1.2, 0.3, -0.7]))
    display = PoseDisplay(frame, arm.T_base_shoulder)
    np.testing.assert_allclose(display.pose(*display.numbers(T)), T, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("limits", "shown"),
    [
        ((-108.861981, 108.861981), (-108.86, 108.86)),
        # Rounding errors of the conversion to radians and back.
        ((-173.35000000000002, 165.64999999999998), (-173.35, 165.65)),
    ],
)
def test_slider_ends_are_rounded_and_inside_the_limits(
    limits: tuple[float, float], shown: tuple[float, float]
) -> None:
    assert ends(*limits) == shown
