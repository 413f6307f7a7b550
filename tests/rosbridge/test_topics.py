"""Topics and the services of rosapi describe the arm and the server."""

from __future__ import annotations

import asyncio
import json
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
    ros,
)


def pose(message: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Return a geometry_msgs/Transform as a matrix (4, 4)."""
    T = np.eye(4)
    turned = message["rotation"]
    T[:3, :3] = so3.from_quaternion([turned[each] for each in "wxyz"])
    T[:3, 3] = [message["translation"][each] for each in "xyz"]
    return T


def test_topics_describe_the_arm_as_it_is(server: AppServer, robot: Robot) -> None:
    async def act() -> None:
        async with ros(server.url) as client:
            at_home = await client.home()
            found = {}
            for topic in ("/joint_states", "/tf", "/tf_static", "/robot_description"):
                await client.say("subscribe", topic=topic)
                found[topic] = await client.message(topic)
            joints = found["/joint_states"]
            assert joints["name"][:5] == JOINTS
            assert joints["position"][:5] == pytest.approx(at_home["q"])
            assert abs(joints["header"]["stamp"]["sec"] - time.time()) < 5.0
            # Frames on the way from the root to the tool give the pose that the API reports.
            edges = {
                each["child_frame_id"]: (each["header"]["frame_id"], pose(each["transform"]))
                for topic in ("/tf", "/tf_static")
                for each in found[topic]["transforms"]
            }
            T, frame = np.eye(4), at_home["tool"]
            while frame != robot.links[0].name:
                frame, step = edges[frame]
                T = step @ T
            T_base_shoulder = robot.require_arm().T_base_shoulder
            assert T_base_shoulder @ np.array(at_home["T"]) == pytest.approx(T, abs=1e-9)
            assert f'<robot name="{robot.name}">' in found["/robot_description"]["data"]

    asyncio.run(act())


@pytest.mark.long
def test_topic_is_sent_at_its_rate_or_more_seldom(server: AppServer) -> None:
    async def act() -> None:
        async with ros(server.url, watches=False) as client:
            await client.say("subscribe", topic="/joint_states", id="a", throttle_rate=250)
            await client.message("/joint_states")
            before = client.counts["/joint_states"]
            await asyncio.sleep(2.0)
            assert 4 <= client.counts["/joint_states"] - before <= 9
            await client.say("subscribe", topic="/joint_states", id="b")
            await client.message("/joint_states")
            before = client.counts["/joint_states"]
            await asyncio.sleep(1.0)
            assert 20 <= client.counts["/joint_states"] - before <= 55
            await client.say("unsubscribe", topic="/joint_states")
            await client.call("/rosapi/nodes")
            before = client.counts["/joint_states"]
            await asyncio.sleep(0.3)
            assert client.counts["/joint_states"] == before

    asyncio.run(act())


@pytest.mark.long
def test_diagnostics_report_a_stop_at_once(server: AppServer) -> None:
    async def act() -> None:
        async with ros(server.url) as client:
            await client.home()
            await client.say("subscribe", topic="/diagnostics")
            arm, loop, driver = (await client.message("/diagnostics"))["status"]
            assert (arm["name"], arm["level"], arm["message"]) == ("katana450: arm", 0, "ok")
            assert {each["key"] for each in loop["values"]} >= {"period [ms]", "ticks lost"}
            assert driver["message"].endswith("drives")
            await client.call("/stop")
            # The next one would be due within a second, which the news of the stop precedes.
            async with asyncio.timeout(0.5):
                while arm["level"] != 2:
                    await asyncio.sleep(0.01)
                    (arm, *_) = client.newest["/diagnostics"]["status"]
            assert "STOP" in arm["message"]
            await client.clear()

    asyncio.run(act())


def test_rosapi_lists_what_there_is(server: AppServer) -> None:
    async def act() -> None:
        async with ros(server.url, watches=False) as client:
            topics = (await client.call("/rosapi/topics"))["values"]
            assert dict(zip(topics["topics"], topics["types"], strict=True))["/tf"] == (
                "tf2_msgs/msg/TFMessage"
            )
            services = (await client.call("/rosapi/services"))["values"]["services"]
            for service in services:
                answer = await client.call("/rosapi/service_type", {"service": service})
                kind = answer["values"]["type"]
                found = (await client.call("/rosapi/services_for_type", type=kind))["values"]
                assert service in found["services"]
            servers = (await client.call("/rosapi/action_servers"))["values"]["action_servers"]
            assert servers == [FOLLOW, GRIPPER]
            given = await client.call("/rosapi/get_param", name="robot_description")
            assert json.loads(given["values"]["value"]).startswith("<?xml")
            now = (await client.call("/rosapi/get_time"))["values"]["time"]
            assert abs(now["sec"] - time.time()) < 5.0
            kind = (await client.call("/rosapi/topic_type", topic="/tf"))["values"]["type"]
            answer = await client.call("/rosapi/topics_for_type", {"type": "tf2_msgs/TFMessage"})
            assert answer["values"]["topics"] == ["/tf", "/tf_static"]
            assert kind == "tf2_msgs/msg/TFMessage"

    asyncio.run(act())
