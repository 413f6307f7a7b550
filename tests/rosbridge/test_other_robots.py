"""Clients of rosbridge drive other robots: six axes, joints without a tool, and a full hand."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import numpy as np
import pytest

from katana450.client import connect
from katana450.maths.geometry import so3
from katana450.server.api import answers
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.browser.server import APP, ROOT, AppServer
from tests.general_arms.links_of_arms import ur5e
from tests.rosbridge.ros_client import FOLLOW, GRIPPER, JOINT_JOG, TWIST, ros, trajectory, twist
from tests.rosbridge.test_motion import stream

pytestmark = pytest.mark.anyio

GANTRY = ROOT / "tests" / "exchange" / "gantry.urdf"


@pytest.mark.long
async def test_joints_of_a_mechanism_are_seen_and_jogged() -> None:
    with AppServer((*APP, "--urdf", str(GANTRY))) as server:
        async with ros(server.url) as client:
            for topic in ("/joint_states", "/tf", "/robot_description"):
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


@pytest.mark.long
async def test_twist_moves_and_turns_the_tool_of_six_axes(tmp_path: Path) -> None:
    urdf = tmp_path / "ur5e.urdf"
    urdf.write_text(ur5e(), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(urdf))) as server:
        async with ros(server.url) as client:
            before = np.array((await client.state())["T"])
            await stream(client, TWIST, twist(vz=-0.2), 0.8)
            after = np.array((await client.when(lambda state: not state["moving"]))["T"])
            moved = after[:3, 3] - before[:3, 3]
            # 0.2 of 0.4 m/s for 0.8 s, and the path to rest.
            assert -0.15 < moved[2] < -0.02
            assert np.abs(moved[:2]).max() < 0.002
            assert after[:3, :3] == pytest.approx(before[:3, :3], abs=0.005)
            before = after
            await stream(client, TWIST, twist("tool0", wz=0.5, wx=0.5), 0.8)
            after = np.array((await client.when(lambda state: not state["moving"]))["T"])
            turned = so3.log(before[:3, :3].T @ after[:3, :3])
            assert 0.1 < turned[0] < 0.6
            assert turned == pytest.approx([turned[0], 0.0, turned[0]], abs=0.01)
            assert np.abs(after[:3, 3] - before[:3, 3]).max() < 0.002
            # Nothing was refused: neither the twists nor the end of a stream.
            assert not [op for op in client.heard if op["op"] == "status"]


def hold_the_cup(url: str) -> float:
    """Let a script grasp the cup; return the finger joint [rad]."""
    with connect(url, "Script") as arm:
        arm.ask(Program(text="tool: grasp\nsteps:\n  - grasp: cup\n"))
        arm.ask(Steer(order=ProgramOrder.RUN))
        end = time.monotonic() + 90.0
        while time.monotonic() < end:
            state = arm.query(answers.State)
            if state.program is not None and state.program.status in ("done", "refused", "failed"):
                assert state.held == "cup", state.program
                return state.gripper
            time.sleep(0.1)
    raise TimeoutError


@pytest.mark.long
async def test_fingers_stall_at_an_object(server: AppServer) -> None:
    width = await asyncio.to_thread(hold_the_cup, server.url)
    async with ros(server.url) as client:
        number = await client.goal(GRIPPER, {"command": {"position": 0.0}})
        result = await client.result(number)
        assert result["status"] == 4
        assert result["values"]["stalled"] is True
        assert result["values"]["reached_goal"] is False
        assert result["values"]["position"] == pytest.approx(width, abs=0.02)
        assert width > 0.01
