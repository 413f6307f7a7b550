"""A client of rosbridge jogs the arm, follows trajectories, cancels and stops."""

from __future__ import annotations

import asyncio
import math
import time
from typing import Any

import numpy as np
import pytest

from tests.browser.server import AppServer
from tests.rosbridge.ros_client import (
    FOLLOW,
    GRIPPER,
    JOINTS,
    TWIST,
    RosClient,
    ros,
    trajectory,
    twist,
)

pytestmark = pytest.mark.anyio

AWAY = [0.4, -1.1, 1.4, 0.2, 0.3]


async def stream(client: RosClient, topic: str, message: dict[str, Any], seconds: float) -> None:
    """Publish ``message`` 30 times a second."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        await client.say("publish", topic=topic, msg=message)
        await asyncio.sleep(1 / 30)


async def test_trajectory_is_followed_with_feedback(client: RosClient) -> None:
    await client.home()
    client.feedback.clear()
    began = time.monotonic()
    # The joints of a goal may be in any order.
    goal = trajectory((1.0, [0.2, -1.15, 1.45, 0.15, 0.1]), (2.0, AWAY))
    goal["trajectory"]["joint_names"] = JOINTS[::-1]
    for point in goal["trajectory"]["points"]:
        point["positions"] = point["positions"][::-1]
    number = await client.goal(FOLLOW, goal)
    result = await client.result(number)
    assert result["result"] is True
    assert (result["status"], result["values"]["error_code"]) == (4, 0)
    assert time.monotonic() - began > 2.0
    assert (await client.state())["q"] == pytest.approx(AWAY, abs=1e-3)
    values = [feedback["values"] for feedback in client.feedback if feedback["id"] == number]
    assert len(values) >= 10
    first, last = (np.array(values[k]["actual"]["positions"]) for k in (0, -1))
    assert np.abs(last - AWAY).max() < np.abs(first - AWAY).max()
    # A goal where the arm stands is reached at once.
    q = (await client.state())["q"]
    result = await client.result(await client.goal(FOLLOW, trajectory((1.0, q))))
    assert result["status"] == 4


async def test_new_trajectory_replaces_the_running_one(client: RosClient) -> None:
    """The replaced goals are cancelled, an invalid one replaces nothing, and STOP ends the last."""
    start = (await client.home())["q"]
    first = await client.goal(FOLLOW, trajectory((9.0, AWAY)))
    await client.when(lambda state: state["moving"])
    invalid = await client.goal(FOLLOW, trajectory((1.0, [9.0] * 4)))
    assert (await client.result(invalid))["status"] == 6
    # The point at time 0 is where the arm was when the goals were sent.
    q = (await client.state())["q"]
    second = await client.goal(FOLLOW, trajectory((0.0, q), (1.5, AWAY)))
    third = await client.goal(FOLLOW, trajectory((0.0, q), (1.0, start)))
    for number in (first, second):
        result = await client.result(number)
        assert result["status"] == 5
        assert "newer trajectory" in result["values"]["error_string"]
    assert (await client.result(third))["status"] == 4
    assert (await client.state())["q"] == pytest.approx(start, abs=1e-3)
    # All goals of an action are cancelled as roslib cancels them, and by /hold.
    for cancel in (f"{FOLLOW}/_action/cancel_goal", "/hold"):
        number = await client.goal(FOLLOW, trajectory((6.0, AWAY)))
        await client.when(lambda state: state["moving"])
        assert (await client.call(cancel))["result"] is True
        assert (await client.result(number))["status"] == 5
    await client.goal(FOLLOW, trajectory((9.0, AWAY)))
    await client.when(lambda state: state["moving"])
    last = await client.goal(FOLLOW, trajectory((1.0, AWAY)))
    assert (await client.call("/stop"))["values"]["success"]
    assert (await client.result(last))["status"] == 5
    rest = (await client.when(lambda state: not state["moving"]))["q"]
    await asyncio.sleep(0.2)
    assert (await client.state())["q"] == pytest.approx(rest, abs=1e-6)


async def test_stop_cancels_a_goal_and_nothing_moves_afterwards(server: AppServer) -> None:
    async with ros(server.url) as client, ros(server.url) as other:
        await client.home()
        number = await client.goal(FOLLOW, trajectory((6.0, AWAY)))
        await client.when(lambda state: state["moving"])
        response = await other.call("/stop")
        assert response["values"] == {"success": True, "message": "requested"}
        result = await client.result(number)
        assert result["status"] == 5
        assert "STOP" in result["values"]["error_string"]
        state = await client.when(lambda state: state["stop"] == "confirmed")
        refused = await client.result(await client.goal(FOLLOW, trajectory((1.0, AWAY))))
        assert (refused["status"], refused["values"]["error_code"]) == (6, -1)
        assert "stopped" in refused["values"]["error_string"]
        await client.say("publish", id="t", topic=TWIST, msg=twist(vx=0.2))
        assert "stopped" in await client.refusal("t")
        values = (await other.call("/clear_stop"))["values"]
        assert values["success"] is False, "the arm was stopped less than a second ago"
        await client.clear()
        await asyncio.sleep(0.2)
        cleared = await client.state()
        assert cleared["stopped"] is None
        assert cleared["q"] == pytest.approx((await client.state())["q"])
        assert cleared["q"] == pytest.approx(state["q"], abs=0.1)
        assert not cleared["moving"]


@pytest.mark.long
async def test_fingers_move_and_report(client: RosClient) -> None:
    await client.home()
    client.feedback.clear()
    number = await client.goal(GRIPPER, {"command": {"position": 0.3, "max_effort": 0.0}})
    result = await client.result(number)
    assert result["status"] == 4
    assert result["values"]["reached_goal"] is True
    assert result["values"]["stalled"] is False
    assert result["values"]["position"] == pytest.approx(0.3, abs=0.01)
    assert any(feedback["id"] == number for feedback in client.feedback)
    number = await client.goal(GRIPPER, {"command": {"position": 0.0}})
    await client.say("cancel_action_goal", id=number, action=GRIPPER)
    result = await client.result(number)
    assert result["status"] == 5
    assert result["values"]["position"] > 0.1


@pytest.mark.long
async def test_stream_over_a_stop_stays_refused_until_it_pauses(client: RosClient) -> None:
    await client.home()
    streaming = asyncio.create_task(stream(client, TWIST, twist(vz=0.2), 5.0))
    await client.when(lambda state: state["moving"])
    await client.call("/stop")
    stopped = await client.when(lambda state: state["stop"] == "confirmed")
    await client.clear()
    assert not streaming.done(), "the stop was cleared during the stream"
    await asyncio.sleep(0.2)
    state = await client.state()
    assert state["stopped"] is None
    assert not state["moving"]
    assert math.dist(state["q"], stopped["q"]) < 0.1
    await streaming
    why = "was stopped or the driver changed"
    assert any(why in op.get("msg", "") for op in client.heard)
    await asyncio.sleep(0.7)
    await stream(client, TWIST, twist(vz=-0.2), 0.4)
    await client.when(lambda state: math.dist(state["q"], stopped["q"]) > 1e-3)


@pytest.mark.long
async def test_client_that_leaves_ends_its_goal(server: AppServer) -> None:
    async with ros(server.url) as other:
        async with ros(server.url) as client:
            await client.home()
            await client.goal(FOLLOW, trajectory((8.0, AWAY)))
            await client.when(lambda state: state["moving"])
        state = await other.when(lambda state: not state["moving"], 5.0)
        assert abs(state["q"][0] - AWAY[0]) > 0.1
        await other.home()


async def test_contact_refuses_a_goal_before_anything_moves(client: RosClient) -> None:
    home = await client.home()
    # Into the table.
    goal = trajectory((3.0, [0.0, 0.05, 1.2, 0.6, 0.0]))
    result = await client.result(await client.goal(FOLLOW, goal))
    assert (result["status"], result["values"]["error_code"]) == (6, -1)
    assert "table" in result["values"]["error_string"]
    assert (await client.state())["q"] == pytest.approx(home["q"])


@pytest.mark.long
async def test_nothing_moves_after_the_result(client: RosClient) -> None:
    """The fingers move while the trajectory is planned, so that the plan does not fit any more."""
    await client.home()
    number = await client.goal(FOLLOW, trajectory((1.5, AWAY)))
    fingers = await client.goal(GRIPPER, {"command": {"position": -0.2, "max_effort": 0.0}})
    await client.result(fingers)
    result = await client.result(number)
    state = await client.state()
    assert (result["status"] == 4) == (state["q"] == pytest.approx(AWAY, abs=1e-3)), result
    assert not state["moving"]
    await asyncio.sleep(0.2)
    assert (await client.state())["q"] == pytest.approx(state["q"], abs=1e-6)
