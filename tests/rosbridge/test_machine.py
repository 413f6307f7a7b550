"""A mechanism that has only joints is seen and jogged; a tool is refused in words."""

from __future__ import annotations

import asyncio
import time

import pytest

from tests.browser.server import APP, ROOT, AppServer
from tests.rosbridge.ros_client import FOLLOW, JOINT_JOG, TWIST, ros, trajectory, twist

pytestmark = pytest.mark.anyio

GANTRY = ROOT / "tests" / "exchange" / "gantry.urdf"


@pytest.mark.long
async def test_joints_of_a_mechanism_are_seen_and_jogged() -> None:
    with AppServer((*APP, "--urdf", str(GANTRY))) as server:
        async with ros(server.url) as client:
            for topic in ("/joint_states", "/tf", "/robot_description", "/diagnostics"):
                await client.say("subscribe", topic=topic)
                await client.message(topic)
            name = client.newest["/joint_states"]["name"][0]
            before = await client.state()
            jog = {"joint_names": [name], "velocities": [0.2]}
            end = time.monotonic() + 0.6
            while time.monotonic() < end:
                await client.say("publish", topic=JOINT_JOG, msg=jog)
                await asyncio.sleep(0.03)
            after = await client.when(lambda state: not state["moving"])
            assert after["q"][0] - before["q"][0] > 0.01
            await client.say("publish", id="t", topic=TWIST, msg=twist(vx=0.1))
            assert "joint" in await client.refusal("t")
            result = await client.result(await client.goal(FOLLOW, trajectory((1.0, [0.0] * 5))))
            assert (result["status"], result["values"]["error_code"]) == (6, -1)
            result = await client.result(await client.goal("/gripper_controller/gripper_cmd", {}))
            assert result["result"] is False
