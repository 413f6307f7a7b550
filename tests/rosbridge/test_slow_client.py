"""A client that reads nothing costs little memory, and no tick and no STOP comes late for it."""

from __future__ import annotations

import asyncio
import json
import socket
import struct
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.browser.server import SIMULATION_APP, AppServer
from tests.gateway.client import ask
from tests.rosbridge.ros_client import FOLLOW, ros, trajectory

pytestmark = pytest.mark.anyio

SECONDS = 6.0
"""[s] Time in which 1.5 MB would be sent to a client that reads."""

MAX_KB = 1000
"""[kB] Memory that one client may cost."""

MAX_LOST = 6
"""Ticks of the 300 that are looked at that a busy machine may delay."""

TOPICS = ("/joint_states", "/tf", "/katana450/state", "/robot_description")


def memory(process: int) -> int:
    """Return the private memory of ``process`` [kB]."""
    rows = Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii").splitlines()
    values = {row.split(":")[0]: int(row.split()[1]) for row in rows[1:]}
    return values["Private_Dirty"] + values["Private_Clean"]


def frame(**op: Any) -> bytes:
    """Return an operation as a frame of a websocket; a mask of zeros leaves the text as it is."""
    text = json.dumps(op).encode()
    length = bytes([0x80 | 126]) + struct.pack(">H", len(text))
    return b"\x81" + (bytes([0x80 | len(text)]) if len(text) < 126 else length) + bytes(4) + text


def deaf_client(url: str, *ops: dict[str, Any]) -> socket.socket:
    """Open a websocket by hand, send ``ops``, and return the socket, which is not read then."""
    host, port = url.removeprefix("http://").split(":")
    line = socket.create_connection((host, int(port)))
    line.sendall(
        f"GET /rosbridge HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    received = b""
    while not received.endswith(b"\r\n\r\n"):
        received += line.recv(1)
    assert b" 101 " in received
    for op in ops:
        line.sendall(frame(**op))
    return line


def loop(url: str) -> dict[str, Any]:
    return dict(json.loads(ask(f"{url}/api/v1/loop")[2]))


@pytest.mark.long
async def test_client_that_reads_nothing_costs_little() -> None:
    with ExitStack() as lines_open, AppServer(SIMULATION_APP) as server:
        async with ros(server.url) as client:
            # What the first client of each kind costs for good is not counted.
            for topic in TOPICS:
                await client.say("subscribe", topic=topic)
                await client.message(topic)
            await client.home()
            away = [0.5, -1.1, 1.4, 0.2, 0.3]
            for goal in (away, [0.0, -1.19, 1.48, 0.14, 0.0]):
                await client.result(await client.goal(FOLLOW, trajectory((1.0, goal))))
            before = memory(server.front)
            # Only the end of each message is written after the buffers of the kernel are full.
            subscriptions = [{"op": "subscribe", "topic": topic} for topic in TOPICS]
            lines = [
                lines_open.enter_context(deaf_client(server.url, *subscriptions)) for _ in range(4)
            ]
            await asyncio.sleep(0.5)
            number = await client.goal(FOLLOW, trajectory((SECONDS, away)))
            await client.when(lambda state: state["moving"])
            lost, began = loop(server.url)["lost"], time.monotonic()
            longest = 0.0
            while time.monotonic() - began < SECONDS / 2:
                start = time.monotonic()
                await client.call("/rosapi/topics")
                longest = max(longest, time.monotonic() - start)
                await asyncio.sleep(0.05)
            assert longest < 0.5
            assert loop(server.url)["lost"] - lost <= MAX_LOST
            assert (await client.result(number))["status"] == 4
            cost = (memory(server.front) - before) / len(lines)
            print(f"{cost:.0f} kB for each client; longest answer {1e3 * longest:.0f} ms")
            assert cost < MAX_KB
            start = time.monotonic()
            await client.call("/stop")
            assert time.monotonic() - start < 0.5


@pytest.mark.long
async def test_goal_of_a_client_that_answers_no_ping_ends() -> None:
    with ExitStack() as lines_open, AppServer(SIMULATION_APP) as server:
        async with ros(server.url) as client:
            goal = trajectory((8.0, [0.8, -1.1, 1.4, 0.2, 0.3]))
            op = {"op": "send_action_goal", "id": "g", "action": FOLLOW, "args": goal}
            line = deaf_client(server.url, op)
            lines_open.callback(line.close)
            await client.when(lambda state: state["moving"])
            began = time.monotonic()
            state = await client.when(lambda state: not state["moving"])
            assert time.monotonic() - began < 4.0
            assert state["program"]["status"] == "stopped"
            assert "no heartbeats" in state["program"]["why"]
            assert state["q"][0] < 0.7
