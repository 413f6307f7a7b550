"""Test hostile messages: they change nothing and harm no other client.

The other browser is a raw client too, so that the messages to it can be compared byte for byte.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec
from websockets.exceptions import ConnectionClosed

from tests.browser.server import AppServer
from tests.gateway.client import SUBPROTOCOL, UPRIGHT, Peer, enter, opened, page_name, websocket
from tests.gateway.hostile import BRIEF, moves_the_arm, peers
from tests.gateway.virtual import VirtualServer

Attack = Callable[[Peer], Any]

GIZMO = {"type": "TransformControlsUpdateMessage", "name": "/target/move", "owner": ""}


async def drag(peer: Peer, wxyz: list[float], position: list[float], **changed: str) -> None:
    """Grab a gizmo, and drag it to a pose."""
    which = {"name": GIZMO["name"], "owner": "", **changed}
    await peer.say(type="TransformControlsDragStartMessage", **which)
    await peer.say(**(which | {"type": GIZMO["type"], "wxyz": wxyz, "position": position}))


ATTACKS: dict[str, Attack] = {
    "a gizmo that was never taken hold of": lambda p: p.say(
        **GIZMO, wxyz=UPRIGHT, position=[0.3, 0.0, 0.2]
    ),
    "a slider that is not a number": lambda p: p.set("1 base turn", value=math.nan),
    "an infinite slider": lambda p: p.set("2 shoulder", value=-math.inf),
    "a slider beyond its range": lambda p: p.set("1 base turn", value=400.0),
    "a slider below its range": lambda p: p.set("3 elbow", value=-117.8),
    "a slider that is text": lambda p: p.set("1 base turn", value="12"),
    "a slider that is a list": lambda p: p.set("1 base turn", value=[1.0]),
    "a slider that is nothing": lambda p: p.set("1 base turn", value=None),
    "a slider that is a yes": lambda p: p.set("1 base turn", value=True),
    "a control taken away": lambda p: p.set("1 base turn", removed=True),
    "a control gone deaf": lambda p: p.set("1 base turn", update_cb=[]),
    "a control with a new range": lambda p: p.set("1 base turn", props={"max": 9999.0}),
    "a value and more": lambda p: p.set("1 base turn", value=10.0, removed=True),
    "no update at all": lambda p: p.set("1 base turn"),
    "a tool there is not": lambda p: p.set("Tool", value="hammer"),
    "a button there is not": lambda p: p.set("Drive", value="Explode"),
    "a typed pose that is not a number": lambda p: p.set("x, y, z", value=[0.0, math.nan, 0.0]),
    "a typed pose with two numbers": lambda p: p.set("x, y, z", value=[0.0, 0.0]),
    "a typed pose out of the world": lambda p: p.set("x, y, z", value=[1e9, 0.0, 0.0]),
    "a control nobody knows": lambda p: p.say(
        type="GuiUpdateMessage", uuid="nobody", updates={"value": 1.0}
    ),
    "a gizmo that is nowhere": lambda p: drag(p, UPRIGHT, [math.nan] * 3),
    "a gizmo out of the world": lambda p: drag(p, UPRIGHT, [1e6, 0.0, 0.0]),
    "a gizmo in two dimensions": lambda p: drag(p, UPRIGHT, [0.1, 0.1]),
    "a rotation that is none": lambda p: drag(p, [0.0] * 4, [0.3, 0.0, 0.2]),
    "a rotation that is not a number": lambda p: drag(p, [math.nan] * 4, [0.3, 0.0, 0.2]),
    "a gizmo nobody knows": lambda p: drag(p, UPRIGHT, [0.3, 0.0, 0.2], name="/arm"),
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


def test_message_that_no_page_sends_changes_nothing(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (bad, good):
            for send in ATTACKS.values():
                await send(bad)
            assert await good.listen() == []
            for name, send in RUDE.items():
                path, cookie = f"/viser?page={page_name()}", enter(server.url)
                # Nobody waits for the scene, nor for an answer.
                async with websocket(
                    server.url, path, cookie, subprotocols=[SUBPROTOCOL]
                ) as socket:
                    with suppress(ConnectionClosed):
                        await send(Peer(socket))
                assert await good.listen(BRIEF) == [], name

    asyncio.run(attack())


def test_sender_of_repeated_bad_messages_is_disconnected(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (bad, good):
            with suppress(ConnectionClosed):
                for _ in range(20):
                    await bad.socket.send(b"\xff\x00\x01")
                    await bad.listen(0.02)
            assert bad.socket.close_code == 1008
            assert await good.listen(BRIEF) == []

    asyncio.run(attack())


def test_arm_obeys_a_valid_browser_after_the_attacks(server: AppServer) -> None:
    async def obey() -> None:
        async with opened(server.url) as (bad, _), opened(server.url) as (good, control):
            await control.say("take")
            await control.wait(mine=True)
            for attack in ATTACKS.values():
                await attack(bad)
            heard = await moves_the_arm(good, 12.5)
            turned = [m for m in heard if m["type"] == "SetOrientationMessage"]
            assert any(m["name"].endswith("/pan_link") for m in turned)
            # The other browser gets the slider, and the same motion.
            messages = await bad.listen()
            assert {"value": 12.5} in [
                m["updates"] for m in messages if m["type"] == "GuiUpdateMessage"
            ]
            # The other browser does not hold the lease: it gets the true value back.
            await bad.set("1 base turn", value=30.0)
            truth = [m["updates"] for m in await bad.listen() if m["type"] == "GuiUpdateMessage"]
            assert truth[-1:] == [{"value": 12.5}]
            assert {"value": 30.0} not in truth
            assert await good.listen(BRIEF) == []
            await moves_the_arm(good, 0.0)

    asyncio.run(obey())
    assert server.running
    assert "Dropped a GuiUpdateMessage" in server.output


def test_invalid_request_changes_nothing(local: VirtualServer) -> None:
    texts = [
        "",
        "no json",
        "[]",
        "null",
        '{"do": "explode"}',
        '{"do": "stop", "more": 1}',
        '{"do": "jog", "rates": [1e999, 0, 0, 0, 0], "frame": "base"}',
        '{"do": "jog", "rates": [9, 0, 0, 0, 0], "frame": "base"}',
        '{"do": "jog", "rates": [0, 0, 0, 0], "frame": "base"}',
        '{"do": "jog", "rates": [0, 0, 0, 0, 0], "frame": "moon"}',
        '{"do": "jog", "rates": ["0", 0, 0, 0, 0], "frame": "base"}',
        '{"do": "speed", "value": 7}',
        '{"do": "give", "to": "1"}',
        "[" * 500,
        "\x00\x01",
    ]

    async def attack() -> None:
        watching = await local.control()
        before = dict(await watching.wait(participants=1, mood="ok"))
        for text in texts:
            control = await local.control()
            await watching.wait(participants=2)
            with suppress(ConnectionClosed):
                for _ in range(10):
                    await control.socket.send(text)
            async with asyncio.timeout(5.0):
                await control.socket.wait_closed()
            assert control.socket.close_code == 1008, text
            assert before == await watching.wait(participants=1), text
        await watching.close()

    local.run(attack())
