"""Topics and lists describe the arm and the server."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.maths.geometry import so3
from tests.browser.server import AppServer
from tests.rosbridge.ros_client import (
    FOLLOW,
    GRIPPER,
    JOINTS,
    RosClient,
    ros,
)

pytestmark = pytest.mark.anyio


def pose(message: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Return a geometry_msgs/Transform as a matrix (4, 4)."""
    T = np.eye(4)
    turned = message["rotation"]
    T[:3, :3] = so3.from_quaternion([turned[axis] for axis in "wxyz"])
    T[:3, 3] = [message["translation"][axis] for axis in "xyz"]
    return T


async def test_topics_describe_the_arm_as_it_is(client: RosClient, robot: Robot) -> None:
    at_home = await client.home()
    latest = {}
    for topic in ("/joint_states", "/tf", "/tf_static", "/robot_description"):
        await client.say("subscribe", topic=topic)
        latest[topic] = await client.message(topic)
    joints = latest["/joint_states"]
    assert joints["name"][:5] == JOINTS
    assert joints["position"][:5] == pytest.approx(at_home["q"])
    assert abs(joints["header"]["stamp"]["sec"] - time.time()) < 5.0
    # Frames on the way from the root to the tool give the pose that the API reports.
    edges = {
        transform["child_frame_id"]: (transform["header"]["frame_id"], pose(transform["transform"]))
        for topic in ("/tf", "/tf_static")
        for transform in latest[topic]["transforms"]
    }
    assert edges["objects/cup"][0] == robot.links[0].name
    T, frame = np.eye(4), at_home["tool"]
    while frame != robot.links[0].name:
        frame, step = edges[frame]
        T = step @ T
    T_base_shoulder = robot.require_arm().T_base_shoulder
    assert T_base_shoulder @ np.array(at_home["T"]) == pytest.approx(T, abs=1e-9)
    description = latest["/robot_description"]["data"]
    assert f'<robot name="{robot.name}">' in description
    assert description.count('filename="package://katana450_description/meshes/') > 50


async def test_topics_services_and_actions_are_listed(server: AppServer) -> None:
    async with ros(server.url, watches=False) as client:
        topics = (await client.call("/rosapi/topics"))["values"]
        assert dict(zip(topics["topics"], topics["types"], strict=True))["/tf"] == (
            "tf2_msgs/msg/TFMessage"
        )
        services = (await client.call("/rosapi/services"))["values"]["services"]
        assert {"/stop", "/hold", "/clear_stop", "/rosapi/topics"} <= set(services)
        servers = (await client.call("/rosapi/action_servers"))["values"]["action_servers"]
        assert servers == [FOLLOW, GRIPPER]
