"""A client of Foxglove's protocol receives frames and joints, and stops the arm."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import struct
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from tests.browser.server import APP, AppServer
from tests.exchange.tools import FOXGLOVE, needs_package
from tests.gateway.client import ask

MESSAGE_DATA, CALL_SERVICE, SERVICE_RESPONSE = 1, 2, 3
"""Codes of binary messages: of the server, of the client, of the server."""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.long
@needs_package(FOXGLOVE)
def test_foxglove_sees_and_stops_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{FOXGLOVE.folder}{os.pathsep}{before}".rstrip(os.pathsep))
    port = free_port()

    async def act() -> None:
        with AppServer((*APP, "--foxglove", str(port))) as server:
            protocols = [Subprotocol("foxglove.sdk.v1")]
            async with (
                asyncio.timeout(30.0),
                connect(f"ws://127.0.0.1:{port}", subprotocols=protocols) as client,
            ):
                topics: dict[str, dict[str, Any]] = {}
                stop = None
                while len(topics) < 3 or stop is None:
                    text = await client.recv()
                    told = json.loads(text)
                    for channel in told.get("channels", []):
                        topics[channel["topic"]] = channel
                    for service in told.get("services", []):
                        stop = service
                assert stop["name"] == "/stop"
                assert topics["/tf"]["schemaName"] == "foxglove.FrameTransforms"
                assert topics["/joint_states"]["schemaName"] == "foxglove.JointStates"
                wanted = {k: topics[each]["id"] for k, each in enumerate(topics)}
                listed = [{"id": k, "channelId": channel} for k, channel in wanted.items()]
                await client.send(json.dumps({"op": "subscribe", "subscriptions": listed}))
                counts = dict.fromkeys(wanted, 0)
                while min(counts.values()) < 10:
                    data = await client.recv()
                    if isinstance(data, bytes) and data[0] == MESSAGE_DATA:
                        number, _, content = *struct.unpack("<IQ", data[1:13]), data[13:]
                        counts[number] += 1
                        topic = list(topics)[number]
                        if topic == "/tf":
                            assert b"pan_link" in content
                            assert b"tcp" in content
                        elif topic == "/joint_states":
                            assert b"axis_5" in content
                        else:
                            assert json.loads(content)["status"] == "ok"
                call = struct.pack("<BIII", CALL_SERVICE, stop["id"], 7, 4) + b"json" + b"{}"
                await client.send(call)
                while True:
                    data = await client.recv()
                    if isinstance(data, bytes) and data[0] == SERVICE_RESPONSE:
                        break
                assert b'"success": true' in data
                while True:
                    state = json.loads(ask(f"{server.url}/api/v1/state")[2])
                    if state["stop"] == "confirmed":
                        break
                    await asyncio.sleep(0.05)
                assert "Foxglove" in state["stopped"]

    asyncio.run(act())
