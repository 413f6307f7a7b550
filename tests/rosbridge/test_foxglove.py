"""A client of Foxglove's protocol receives frames and joints, and can only stop the arm."""

from __future__ import annotations

import asyncio
import importlib
import json
import os
import socket
import struct
from types import SimpleNamespace
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin, Subprotocol

from tests.browser.server import APP, AppServer
from tests.exchange.tools import FOXGLOVE, needs_package
from tests.gateway.client import ask

MESSAGE_DATA, CALL_SERVICE, SERVICE_RESPONSE = 1, 2, 3
"""Codes of binary messages: of the server, of the client, of the server."""


Offers = dict[str, dict[str, Any]]
"""Descriptions by their names."""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


async def offers(client: ClientConnection) -> tuple[Offers, Offers, list[str]]:
    """Return the topics and services by their names, and the capabilities of the server."""
    topics: Offers = {}
    services: Offers = {}
    capabilities: list[str] = []
    while len(topics) < 3 or not services:
        message = json.loads(await client.recv())
        capabilities += message.get("capabilities", [])
        topics |= {channel["topic"]: channel for channel in message.get("channels", [])}
        services |= {service["name"]: service for service in message.get("services", [])}
    return topics, services, capabilities


@pytest.mark.anyio
@pytest.mark.long
@needs_package(FOXGLOVE)
async def test_foxglove_sees_and_stops_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{FOXGLOVE.folder}{os.pathsep}{before}".rstrip(os.pathsep))
    port = free_port()
    with AppServer((*APP, "--foxglove", str(port))) as server:
        protocols = [Subprotocol("foxglove.sdk.v1")]
        # As a page of any site connects: the library does not check its origin.
        page = connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=protocols,
            origin=Origin("https://elsewhere.example"),
        )
        old = [Subprotocol("foxglove.websocket.v1")]
        with pytest.raises(InvalidStatus) as refused:
            await connect(f"ws://127.0.0.1:{port}", subprotocols=old)
        assert refused.value.response.status_code == 400
        assert refused.value.response.body.startswith(b"Missing expected sec-websocket-protocol")
        async with asyncio.timeout(30.0), page as client:
            topics, services, capabilities = await offers(client)
            # Nothing but the STOP is accepted: no topics and parameters of clients.
            assert set(services) == {"/stop"}
            assert capabilities == ["services"]
            stop = services["/stop"]
            assert topics["/tf"]["schemaName"] == "foxglove.FrameTransforms"
            assert topics["/joint_states"]["schemaName"] == "foxglove.JointStates"
            wanted = {k: topics[topic]["id"] for k, topic in enumerate(topics)}
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


@needs_package(FOXGLOVE)
def test_error_in_one_state_ends_neither_the_picture_nor_the_log(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.syspath_prepend(FOXGLOVE.folder)
    module = importlib.import_module("katana450.extensions.rosbridge.foxglove_server")
    server = object.__new__(module.FoxgloveServer)
    monkeypatch.setattr(
        server, "_hub", SimpleNamespace(arm=SimpleNamespace(age=0.0)), raising=False
    )
    published = iter((ValueError("first"), ValueError("first"), None, ValueError("first")))

    def publish(_: object) -> None:
        error = next(published, SystemExit())
        if error is not None:
            raise error

    monkeypatch.setattr(server, "_publish", publish)
    with pytest.raises(SystemExit):
        server._run()
    # An error that lasts is logged once; one that comes back, again.
    assert [record.message for record in caplog.records] == [
        "Error in the connection of Foxglove."
    ] * 2
