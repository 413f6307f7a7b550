"""The camera on the hand: it looks between the fingers, and moves with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.assembly.robot_session import describe_robot
from katana450.extensions.media.wrist_camera import WristCamera
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.general_arms.gripping_arms import gripping_urdf
from tests.general_arms.published_hands import ROBOTIQ_2F_85, hand_urdf, so101_urdf

SIZE = (160, 120)
HANDS = {
    "Panda": gripping_urdf("Panda"),
    "Robotiq 2F-85": hand_urdf("UR5e", ROBOTIQ_2F_85),
    "SO-101": so101_urdf(),
    "Katana450": "",
}


EVERY = [pytest.param(name, marks=pytest.mark.long if urdf else ()) for name, urdf in HANDS.items()]


@pytest.mark.parametrize("name", EVERY)
def test_camera_looks_at_the_tool_point_from_beside_the_hand(name: str, tmp_path: Path) -> None:
    path = URDF_PATH
    if HANDS[name]:
        path = tmp_path / "arm.urdf"
        path.write_text(HANDS[name], encoding="utf-8")
    robot, session, _ = describe_robot(Settings(), path, None)
    camera = WristCamera(robot, session)
    for turn in (0.0, 0.5):
        q = session.ready + turn * np.eye(len(session.ready))[0]
        state = session.begin(q, robot.require_arm().gripper.opened, 0.0)
        shot = camera.of(state, SIZE)
        right, up, forward = shot.frame
        point = session.environment.tool_point(state.x) - shot.position
        assert (point @ right, point @ up) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert 0.05 < point @ forward < 0.5
        # Up in the picture is up, or away from the arm.
        assert up[2] > 0.3 or up[:2] @ (np.array(shot.position)[:2]) > 0.0


def test_link_for_a_camera_is_its_frame(tmp_path: Path) -> None:
    link = (
        '<link name="wrist_camera_optical_frame"/><joint name="mount" type="fixed">'
        '<parent link="gripper_link"/><child link="wrist_camera_optical_frame"/>'
        '<origin xyz="0 0.1 0" rpy="0 0 0"/></joint></robot>'
    )
    path = tmp_path / "arm.urdf"
    path.write_text(so101_urdf().replace("</robot>", link), encoding="utf-8")
    robot, session, _ = describe_robot(Settings(), path, None)
    state = session.begin(session.ready, robot.require_arm().gripper.opened, 0.0)
    shot = WristCamera(robot, session).of(state, SIZE)
    T = robot.frames(robot.joint_values(state.q, state.gripper))["gripper_link"]
    np.testing.assert_allclose(shot.position, (T @ (0.0, 0.1, 0.0, 1.0))[:3], atol=1e-9)
    np.testing.assert_allclose(shot.frame, (T[:3, 0], -T[:3, 1], T[:3, 2]), atol=1e-6)
