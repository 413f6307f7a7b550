"""Everything that a client may not send is refused in words, and nothing moves."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from katana450.extensions.rosbridge.protocol import MAX_OP_BYTES
from tests.browser.server import AppServer
from tests.rosbridge.ros_client import (
    FOLLOW,
    GRIPPER,
    JOINT_JOG,
    JOINTS,
    TWIST,
    RosClient,
    ros,
    trajectory,
    twist,
)

pytestmark = pytest.mark.anyio

HOME = [0.0, -1.19, 1.48, 0.14, 0.0]

TEXTS = {
    "nothing": ("", "not a valid message"),
    "no JSON": ("{op:", "not a valid message"),
    "no object": ("[1, 2]", "not a valid message"),
    "no op": ("{}", "missing required field `op`"),
    "op of another type": ('{"op": 5}', "not a valid message"),
    "unknown op": ('{"op": "teleport", "id": "x"}', "no op 'teleport'. It has advertise"),
    "op of a server": ('{"op": "advertise_service", "service": "/a"}', "no op 'advertise_service'"),
    "fragment": ('{"op": "fragment", "data": "x"}', "no op 'fragment'"),
    "topic of another type": ('{"op": "subscribe", "topic": 5}', "$.topic"),
    "NaN": ('{"op": "subscribe", "topic": "/tf", "throttle_rate": NaN}', "invalid character"),
    "infinite": ('{"op": "subscribe", "topic": "/tf", "throttle_rate": 1e999}', "out of range"),
    "negative": ('{"op": "subscribe", "topic": "/tf", "throttle_rate": -1}', ">= 0"),
    "deep": ("[" * 100_000, "not a valid message"),
    "too large": (json.dumps({"op": "x" * MAX_OP_BYTES}), "at most 320 KB"),
}


def op(name: str, **fields: Any) -> dict[str, Any]:
    return {"op": name, **fields}


def moved_by(**parts: Any) -> dict[str, Any]:
    """Return a message of MoveIt Servo that moves the tool."""
    return op("publish", topic=TWIST, msg=parts)


def jogged(*names: str, **lists: Any) -> dict[str, Any]:
    """Return a message of MoveIt Servo that moves joints."""
    return op("publish", topic=JOINT_JOG, msg={"joint_names": list(names), **lists})


def followed(**fields: Any) -> dict[str, Any]:
    return op("send_action_goal", action=FOLLOW, **fields)


TOLERANCE = trajectory((1.0, HOME), path_tolerance=[{"name": "axis_1", "position": 0.1}])

OLD = {**twist(vx=0.1), "header": {"stamp": {"sec": 1_600_000_000}}}

STATES = "sensor_msgs/JointState"

OPS: dict[str, tuple[dict[str, Any], str]] = {
    "unknown topic": (op("subscribe", topic="/camera"), "/camera does not exist"),
    "topic of commands": (op("subscribe", topic=TWIST), "only for commands"),
    "wrong type of a topic": (
        op("subscribe", topic="/tf", type="std_msgs/String"),
        "are tf2_msgs/msg/TFMessage, not std_msgs/String",
    ),
    "compression": (op("subscribe", topic="/tf", compression="cbor"), "'cbor'"),
    "fragments": (op("subscribe", topic="/tf", fragment_size=100), "fragment_size"),
    "no subscription": (op("unsubscribe", topic="/tf"), "no subscription"),
    "advertised by the server": (
        op("advertise", topic="/joint_states", type=STATES),
        "published by the server",
    ),
    "advertised unknown": (op("advertise", topic="/a", type="a/b"), "/a is unknown"),
    "advertised with a wrong type": (
        op("advertise", topic=TWIST, type="geometry_msgs/Twist"),
        "are geometry_msgs/msg/TwistStamped, not geometry_msgs/Twist",
    ),
    "unadvertised unknown": (op("unadvertise", topic="/a"), "/a is unknown"),
    "published unknown": (op("publish", topic="/cmd_vel", msg={}), "is unknown"),
    "unknown service": (op("call_service", service="/dance"), "no service /dance"),
    "arguments of a trigger": (
        op("call_service", service="/hold", args={"hard": True}),
        "unknown field `hard`",
    ),
    "unknown action": (op("send_action_goal", action="/fly"), "no action /fly"),
    "wrong type of an action": (followed(action_type="a/b"), "FollowJointTrajectory, not a/b"),
    "goal of another type": (followed(args={"order": 5}), "unknown field `order`"),
    "tolerance of a joint": (followed(args=TOLERANCE), "path_tolerance"),
    "goal of the fingers": (
        op("send_action_goal", action=GRIPPER, args={"command": {"position": "open"}}),
        "Expected `float`",
    ),
    "no goal": (op("cancel_action_goal", action=FOLLOW), "There is no goal"),
    "Twist without a header": (moved_by(linear={"x": 0.1}), "unknown field `linear`"),
    "no number": (moved_by(twist={"linear": {"x": "fast"}}), "Expected `float`"),
    "too fast": (moved_by(**twist(vx=1.5)), "from -1 to 1"),
    "turning too fast": (moved_by(**twist(wx=-2)), "`angular.x`"),
    "no axis": (moved_by(**twist("tcp", wz=0.3)), "five axes"),
    "no frame": (moved_by(**twist("map", vx=0.1)), "no frame 'map'"),
    "old": (moved_by(**OLD), "leave its stamp zero"),
    "unknown joint": (
        jogged("a", velocities=[0.1]),
        "There is no joint 'a'. The joints are axis_1",
    ),
    "repeated joint": (jogged("axis_1", "axis_1", velocities=[0.1, 0.1]), "named twice"),
    "no velocity": (jogged("axis_1"), "1 names of joints and 0 velocities"),
    "displacement": (jogged("axis_1", velocities=[0.1], displacements=[0.1]), "not supported"),
    "joint too fast": (jogged("axis_1", velocities=[3.0]), "The velocity of axis_1 is 3"),
}

GOALS: dict[str, tuple[dict[str, Any], int, str]] = {
    "no points": (trajectory(), -1, "0 points"),
    "too many points": (trajectory(*[(0.01 * k, HOME) for k in range(1, 802)]), -1, "801 points"),
    "other joints": (
        {"trajectory": {"joint_names": JOINTS[:4], "points": []}},
        -2,
        "must be axis_1, axis_2",
    ),
    "missing position": (trajectory((1.0, HOME[:4])), -1, "has 4 positions; it must have 5"),
    "not later": (trajectory((1.0, HOME), (1.0, HOME)), -1, "Point 2 has the time 1 s"),
    "beyond a limit": (trajectory((3.0, [9.0, *HOME[1:]])), -1, "axis 1 would be"),
    "somewhere else at once": (
        trajectory((0.0, [1.0, *HOME[1:]])),
        -1,
        "from where the arm stands",
    ),
    "too long": (trajectory((4000.0, HOME)), -1, "at most 600 s"),
}


async def moved(client: RosClient, before: dict[str, Any]) -> float:
    """Return how far a joint or finger has moved since the state ``before``."""
    now = await client.state()
    q = zip((*now["q"], now["gripper"]), (*before["q"], before["gripper"]), strict=True)
    return float(max(abs(a - b) for a, b in q))


async def test_text_that_is_no_operation_is_refused_in_words(client: RosClient) -> None:
    before = await client.state()
    for name, (text, why) in TEXTS.items():
        await client.socket.send(text)
        assert why in await client.refusal(), name
    await client.socket.send(b"\x00\x01")
    assert "not a valid message" in await client.refusal()
    # The connection still serves, and an id is repeated.
    await client.say("teleport", id="x")
    assert "teleport" in await client.refusal("x")
    assert await moved(client, before) == 0.0


async def test_operation_that_is_not_possible_is_refused_in_words(client: RosClient) -> None:
    before = await client.state()
    for number, (name, (op, why)) in enumerate(OPS.items()):
        await client.say(**op, id=f"op {number}")
        assert why in await client.refusal(f"op {number}"), name
        if op["op"] in ("call_service", "send_action_goal"):
            ended = await client.answer_to(f"op {number}")
            assert ended["result"] is False, name
            assert why in ended["values"], name
    assert await moved(client, before) == 0.0


async def test_goal_that_is_not_possible_is_aborted_with_its_code(client: RosClient) -> None:
    before = await client.state()
    for name, (goal, code, why) in GOALS.items():
        result = await client.result(await client.goal(FOLLOW, goal))
        assert (result["status"], result["values"]["error_code"]) == (6, code), name
        assert why in result["values"]["error_string"], name
    old = trajectory((1.0, HOME))
    old["trajectory"]["header"] = {"stamp": {"sec": int(time.time()) - 60}}
    result = await client.result(await client.goal(FOLLOW, old))
    assert result["values"]["error_code"] == -3
    for command, why in (
        ({"position": 9.0}, "is not between"),
        ({"position": 0.1, "max_effort": 5.0}, "max_effort"),
    ):
        result = await client.result(await client.goal(GRIPPER, {"command": command}))
        assert (result["status"], result["result"]) == (6, False)
        assert why in result["values"]
    await client.say("send_action_goal", action=GRIPPER, args={})
    assert "needs an `id`" in await client.refusal()
    assert await moved(client, before) == 0.0


async def test_client_of_many_invalid_messages_is_disconnected_with_the_reason(
    server: AppServer,
) -> None:
    async with ros(server.url, watches=False) as client:
        for _ in range(40):
            await client.say("teleport")
        await client.until(lambda op: "Too many invalid" in op.get("msg", ""))
        await client.socket.wait_closed()
        assert client.socket.close_code == 1008


async def test_message_beyond_all_limits_closes_the_connection_alone(server: AppServer) -> None:
    async with ros(server.url) as other:
        async with ros(server.url, watches=False) as client:
            # The server may close before all of it is sent.
            with suppress(ConnectionClosed):
                await client.socket.send("x" * 600_000)
            await client.socket.wait_closed()
            assert client.socket.close_code == 1009
        await other.state()
