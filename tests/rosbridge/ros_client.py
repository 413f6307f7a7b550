"""A plain client of rosbridge: operations as JSON on a websocket."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from tests.gateway.client import websocket

JOINTS = ["axis_1", "axis_2", "axis_3", "axis_4", "axis_5"]

FOLLOW = "/arm_controller/follow_joint_trajectory"
GRIPPER = "/gripper_controller/gripper_cmd"
TWIST = "/servo_node/delta_twist_cmds"
JOINT_JOG = "/servo_node/delta_joint_cmds"


def stamp(seconds: float) -> dict[str, int]:
    """Return a duration of ROS 2."""
    return {"sec": int(seconds), "nanosec": round(1e9 * (seconds % 1.0))}


def trajectory(*points: tuple[float, list[float]], **more: Any) -> dict[str, Any]:
    """Return a goal through postures [rad] at times [s] after its start."""
    rows = [{"positions": q, "time_from_start": stamp(t)} for t, q in points]
    return {"trajectory": {"joint_names": JOINTS, "points": rows}, **more}


def twist(frame: str = "", **parts: float) -> dict[str, Any]:
    """Return a TwistStamped; ``vx`` is linear.x, ``wy`` is angular.y, and so on."""
    twist: dict[str, dict[str, float]] = {"linear": {}, "angular": {}}
    for name, value in parts.items():
        twist["linear" if name[0] == "v" else "angular"][name[1]] = value
    return {"header": {"frame_id": frame}, "twist": twist}


class RosClient:
    """A connection. What was received is kept by topic, and in ``heard`` otherwise."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.heard: deque[dict[str, Any]] = deque(maxlen=1000)
        self.newest: dict[str, dict[str, Any]] = {}
        self.counts: dict[str, int] = {}
        self.feedback: list[dict[str, Any]] = []
        self._ids = itertools.count(1)
        self._task = asyncio.create_task(self._listen())

    async def _listen(self) -> None:
        with suppress(ConnectionClosed):
            async for text in self.socket:
                op = json.loads(text)
                if op["op"] == "publish":
                    self.newest[op["topic"]] = op["msg"]
                    self.counts[op["topic"]] = self.counts.get(op["topic"], 0) + 1
                elif op["op"] == "action_feedback":
                    self.feedback.append(op)
                else:
                    self.heard.append(op)

    async def close(self) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def say(self, op: str, **fields: Any) -> None:
        await self.socket.send(json.dumps({"op": op, **fields}))

    async def until(
        self, matches: Callable[[dict[str, Any]], bool], seconds: float = 10.0
    ) -> dict[str, Any]:
        """Wait for an operation, remove it, and return it."""
        async with asyncio.timeout(seconds):
            while True:
                for op in self.heard:
                    if matches(op):
                        self.heard.remove(op)
                        return op
                await asyncio.sleep(0.005)

    async def refusal(self, op_id: Any = None) -> str:
        """Return the text of the next status for ``op_id``, or of any if it is None."""
        op = await self.until(
            lambda op: op["op"] == "status" and (op_id is None or op.get("id") == op_id)
        )
        assert op["level"] == "error", op
        return str(op["msg"])

    async def answer_to(self, op_id: str) -> dict[str, Any]:
        """Return the next operation with this id."""
        return await self.until(lambda op: op.get("id") == op_id)

    async def message(self, topic: str, seconds: float = 10.0) -> dict[str, Any]:
        """Return a message of ``topic`` that is newer than this call."""
        before = self.counts.get(topic, 0)
        async with asyncio.timeout(seconds):
            while self.counts.get(topic, 0) == before:
                await asyncio.sleep(0.005)
        return self.newest[topic]

    async def state(self) -> dict[str, Any]:
        """Return the state of the API; /katana450/state must be subscribed."""
        return dict(json.loads((await self.message("/katana450/state"))["data"]))

    async def when(
        self, true: Callable[[dict[str, Any]], bool], seconds: float = 20.0
    ) -> dict[str, Any]:
        """Return the first state for which ``true`` returns True."""
        async with asyncio.timeout(seconds):
            while True:
                state = await self.state()
                if true(state):
                    return state

    async def call(
        self, service: str, args: dict[str, Any] | None = None, **more: Any
    ) -> dict[str, Any]:
        """Call a service and return the operation with its response."""
        number = f"call {next(self._ids)}"
        await self.say("call_service", id=number, service=service, args={**(args or {}), **more})
        return await self.until(
            lambda op: op["op"] == "service_response" and op.get("id") == number
        )

    async def goal(self, action: str, args: dict[str, Any], **more: Any) -> str:
        """Send a goal with feedback and return its id."""
        number = f"goal {next(self._ids)}"
        fields = {"id": number, "action": action, "args": args, "feedback": True, **more}
        await self.say("send_action_goal", **fields)
        return number

    async def result(self, number: str, seconds: float = 30.0) -> dict[str, Any]:
        return await self.until(
            lambda op: op["op"] == "action_result" and op.get("id") == number, seconds
        )

    async def clear(self) -> None:
        """Clear a stop once that is possible."""
        while True:
            values = (await self.call("/clear_stop"))["values"]
            if values["success"]:
                return
            await asyncio.sleep(0.1)

    async def home(self) -> dict[str, Any]:
        """Clear a stop and bring the arm to its ready posture; return the state there."""
        state = await self.state()
        if state["stopped"] is not None:
            await self.clear()
        await self.when(lambda state: not state["moving"])
        ready = [0.0, -1.19, 1.48, 0.14, 0.0]
        number = await self.goal(FOLLOW, trajectory((0.5, ready)))
        result = await self.result(number)
        assert result["status"] == 4, result
        return await self.when(lambda state: not state["moving"])


@asynccontextmanager
async def ros(
    url: str, query: str = "", cookie: str = "", *, watches: bool = True, **options: Any
) -> AsyncIterator[RosClient]:
    """Connect a client; ``watches`` subscribes to the state."""
    options = {"origin": None, **options}
    async with websocket(url, f"/rosbridge{query}", cookie, **options) as socket:
        client = RosClient(socket)
        try:
            if watches:
                await client.say("subscribe", topic="/katana450/state", id="state")
            yield client
        finally:
            await client.close()


async def cleared(url: str) -> None:
    """Clear the stop of the arm at ``url``."""
    async with ros(url) as client:
        await client.clear()
