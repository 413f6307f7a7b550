"""A hostile browser: raw WebSocket messages that change nothing and harm nobody else.

The other browser here is a raw client too, so that what it is sent can be looked at byte for byte.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from typing import Any

import msgspec
import pytest
import viser
import zstandard
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from tests.browser.server import BARE_APP, AppServer

QUIET = 0.4
"""[s] Long enough for the server to have sent whatever a message makes it send."""

BRIEF = 0.1
"""[s] Long enough for the next frame: six of the view's."""


class Peer:
    """A viser client without a browser."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.controls: dict[str, dict[str, Any]] = {}

    async def listen(self, quiet: float = QUIET) -> list[dict[str, Any]]:
        """Messages until none has come for ``quiet`` [s]."""
        heard: list[dict[str, Any]] = []
        while True:
            try:
                frame = await asyncio.wait_for(self.socket.recv(), quiet)
            except TimeoutError:
                return heard
            assert isinstance(frame, bytes)
            packed = int.from_bytes(frame[8:16], "little")
            body = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed])
            heard += msgspec.msgpack.decode(body)["messages"]

    async def learn(self) -> None:
        """Take in the scene and the panel, and say where it looks from, as a page does.

        viser counts a browser as there from its first camera on.
        """
        await self.say(
            type="ViewerCameraMessage",
            wxyz=UPRIGHT,
            position=[1.0, 0.0, 1.0],
            fov=0.7,
            near=0.01,
            far=100.0,
            image_height=800,
            image_width=1280,
            look_at=[0.0, 0.0, 0.0],
            up_direction=[0.0, 0.0, 1.0],
        )
        for message in await self.listen():
            label = message.get("props", {}).get("label")
            if message["type"].startswith("Gui") and label:
                self.controls[label] = message

    async def say(self, **message: Any) -> None:
        await self.socket.send(msgspec.msgpack.encode(message))

    async def set(self, label: str, **updates: Any) -> None:
        """Change attributes of the control with this label."""
        uuid = self.controls[label]["uuid"]
        await self.say(type="GuiUpdateMessage", uuid=uuid, updates=updates)

    async def drag(self, wxyz: list[float], position: list[float], **changed: str) -> None:
        """Take hold of a gizmo, drag it to a pose, and let go."""
        which = {"name": GIZMO["name"], "owner": "", **changed}
        await self.say(type="TransformControlsDragStartMessage", **which)
        update = {"type": GIZMO["type"], "wxyz": wxyz, "position": position}
        await self.say(**(which | update))


@asynccontextmanager
async def peers(url: str) -> AsyncIterator[tuple[Peer, Peer]]:
    """A client that means ill and one that watches."""
    address = url.replace("http", "ws")
    subprotocol = Subprotocol(f"viser-v{viser.__version__}")
    async with (
        connect(address, subprotocols=[subprotocol], max_size=None) as bad,
        connect(address, subprotocols=[subprotocol], max_size=None) as good,
    ):
        pair = Peer(bad), Peer(good)
        for peer in pair:
            await peer.learn()
        yield pair


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer() as server:
        yield server


Attack = Callable[[Peer], Any]

GIZMO = {"type": "TransformControlsUpdateMessage", "name": "/target/move", "owner": ""}
UPRIGHT = [1.0, 0.0, 0.0, 0.0]

ATTACKS: dict[str, Attack] = {
    "a gizmo that was never taken hold of": lambda p: p.say(
        **GIZMO, wxyz=UPRIGHT, position=[0.3, 0.0, 0.2]
    ),
    "a slider that is not a number": lambda p: p.set("Axis 1", value=math.nan),
    "an infinite slider": lambda p: p.set("Axis 2", value=-math.inf),
    "a slider beyond its range": lambda p: p.set("Axis 1", value=400.0),
    "a slider below its range": lambda p: p.set("Axis 3", value=-117.8),
    "a slider that is text": lambda p: p.set("Axis 1", value="12"),
    "a slider that is a list": lambda p: p.set("Axis 1", value=[1.0]),
    "a slider that is nothing": lambda p: p.set("Axis 1", value=None),
    "a slider that is a yes": lambda p: p.set("Axis 1", value=True),
    "a control taken away": lambda p: p.set("Axis 1", removed=True),
    "a control gone deaf": lambda p: p.set("Axis 1", update_cb=[]),
    "a control with a new range": lambda p: p.set("Axis 1", props={"max": 9999.0}),
    "a value and more": lambda p: p.set("Axis 1", value=10.0, removed=True),
    "no update at all": lambda p: p.set("Axis 1"),
    "a tool there is not": lambda p: p.set("Tool", value="hammer"),
    "a button there is not": lambda p: p.set("Drive", value="Explode"),
    "a typed pose that is not a number": lambda p: p.set("x, y, z", value=[0.0, math.nan, 0.0]),
    "a typed pose with two numbers": lambda p: p.set("x, y, z", value=[0.0, 0.0]),
    "a typed pose out of the world": lambda p: p.set("x, y, z", value=[1e9, 0.0, 0.0]),
    "a control nobody knows": lambda p: p.say(
        type="GuiUpdateMessage", uuid="nobody", updates={"value": 1.0}
    ),
    "a gizmo that is nowhere": lambda p: p.drag(UPRIGHT, [math.nan] * 3),
    "a gizmo out of the world": lambda p: p.drag(UPRIGHT, [1e6, 0.0, 0.0]),
    "a gizmo in two dimensions": lambda p: p.drag(UPRIGHT, [0.1, 0.1]),
    "a rotation that is none": lambda p: p.drag([0.0] * 4, [0.3, 0.0, 0.2]),
    "a rotation that is not a number": lambda p: p.drag([math.nan] * 4, [0.3, 0.0, 0.2]),
    "a gizmo nobody knows": lambda p: p.drag(UPRIGHT, [0.3, 0.0, 0.2], name="/arm"),
    "a tunnel to the world": lambda p: p.say(type="ShareUrlRequest"),
    "a script for everyone": lambda p: p.say(type="RunJavascriptMessage", source="alert(1)"),
    "a scene taken away": lambda p: p.say(type="RemoveSceneNodeMessage", name="/arm"),
    "an upload": lambda p: p.say(
        type="FileTransferStartUpload",
        source_component_uuid="x",
        transfer_uuid="y",
        filename="z",
        mime_type="a/b",
        part_count=1,
        size_bytes=1,
    ),
}

RUDE: dict[str, Attack] = {
    "a gizmo of text": lambda p: p.say(**GIZMO, wxyz=UPRIGHT, position=["a", "b", "c"]),
    "bytes that are no message": lambda p: p.socket.send(b"\xff\x00\x01"),
    "text": lambda p: p.socket.send("hello"),
    "a message of no kind": lambda p: p.say(kind="none"),
    "a message of an unknown kind": lambda p: p.say(type="NoSuchMessage"),
    "a message with parts missing": lambda p: p.say(type="GuiUpdateMessage"),
    "a list": lambda p: p.socket.send(msgspec.msgpack.encode([1, 2, 3])),
    "nothing": lambda p: p.socket.send(b""),
}


async def moves_the_arm(good: Peer, degrees: float) -> list[dict[str, Any]]:
    await good.set("Axis 1", value=degrees)
    return await good.listen()


def test_a_message_no_page_sends_changes_nothing(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (bad, good):
            for name, send in ATTACKS.items():
                await send(bad)
                assert await good.listen(BRIEF) == [], name
            assert await bad.listen() == []
            assert await good.listen() == []

    asyncio.run(attack())


def test_what_is_no_message_closes_its_sender_at_most(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (_, good):
            for name, send in RUDE.items():
                async with peers(server.url) as (bad, _):
                    with suppress(ConnectionClosed):
                        await send(bad)
                        await bad.listen(BRIEF)
                assert await good.listen(BRIEF) == [], name

    asyncio.run(attack())


def test_after_all_that_the_arm_still_obeys_a_good_browser(server: AppServer) -> None:
    async def obey() -> None:
        async with peers(server.url) as (bad, good):
            for attack in ATTACKS.values():
                await attack(bad)
            heard = await moves_the_arm(good, 12.5)
            turned = [m for m in heard if m["type"] == "SetOrientationMessage"]
            assert any(m["name"].endswith("/pan_link") for m in turned)
            # The other browser is told of the slider, and of the same motion.
            told = await bad.listen()
            assert {"value": 12.5} in [
                m["updates"] for m in told if m["type"] == "GuiUpdateMessage"
            ]
            await moves_the_arm(good, 0.0)

    asyncio.run(obey())
    assert server.running
    assert "Dropped a GuiUpdateMessage" in server.output


def test_an_attack_without_the_guard_would_do_harm() -> None:
    """What the guard is for: bare viser lets the same message disable a control for everyone."""

    async def attack(url: str) -> list[dict[str, Any]]:
        async with peers(url) as (bad, good):
            await good.set("Axis 1", value=10.0)
            assert await good.listen()
            await bad.set("Axis 1", removed=True)
            await good.listen()
            await good.set("Axis 1", value=20.0)
            return await good.listen()

    with AppServer(BARE_APP) as bare:
        assert asyncio.run(attack(bare.url)) == []
