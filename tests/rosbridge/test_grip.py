"""Fingers that close on an object report that they stall there."""

from __future__ import annotations

import asyncio
import time

import pytest

from katana450.client import connect
from katana450.server.api import answers
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.browser.server import AppServer
from tests.rosbridge.ros_client import GRIPPER, ros

pytestmark = pytest.mark.anyio


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
