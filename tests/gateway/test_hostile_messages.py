"""Hostile pages and programs: messages that no page sends, floods, and clients that never read."""

from __future__ import annotations

import asyncio
import math
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from typing import Any

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from katana450.server.web.security import MAX_MESSAGE_BYTES
from tests.browser.server import AppServer
from tests.gateway.client import (
    QUIET,
    SUBPROTOCOL,
    UPRIGHT,
    Peer,
    controlling,
    enter,
    opened,
    page_name,
    state_of,
    websocket,
)
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


async def test_broken_message_changes_nothing(server: AppServer) -> None:
    async with peers(server.url) as (_, good):
        for name, send in RUDE.items():
            path, cookie = f"/viser?page={page_name()}", enter(server.url)
            # Nobody waits for the scene, nor for an answer.
            async with websocket(server.url, path, cookie, subprotocols=[SUBPROTOCOL]) as socket:
                with suppress(ConnectionClosed):
                    await send(Peer(socket))
            assert await good.listen(BRIEF) == [], name


async def test_message_that_no_page_sends_changes_nothing(server: AppServer) -> None:
    async with opened(server.url) as (bad, _), opened(server.url) as (good, control):
        await control.say("take")
        await control.wait(mine=True)
        for attack in ATTACKS.values():
            await attack(bad)
        assert await good.listen() == []
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
    assert server.running
    assert "Dropped a GuiUpdateMessage" in server.output


async def test_invalid_request_changes_nothing(local: VirtualServer) -> None:
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


@pytest.mark.long
def test_closed_browser_receives_no_more_frames(server: AppServer) -> None:
    """Each browser is closed while the scene is being sent to it."""

    async def knock(cookie: str) -> None:
        path = f"/viser?page={page_name()}"
        # A busy server may still count closed connections, and refuse more of this address.
        with suppress(ConnectionClosed, InvalidHandshake, ConnectionError):
            async with websocket(server.url, path, cookie, subprotocols=[SUBPROTOCOL]) as bad:
                for _ in range(200):
                    await bad.send(b"\xff")
                await asyncio.wait_for(bad.wait_closed(), 30.0)

    async def crowd() -> None:
        cookie = enter(server.url)
        for _ in range(40):
            await asyncio.gather(*(knock(cookie) for _ in range(8)))

    asyncio.run(crowd())
    assert server.running
    assert "sent too many invalid messages" in server.output
    assert "Traceback" not in server.output


async def round_trip(control: Any) -> float:
    """Return the time [s] from a request to the status that it causes."""
    started = time.perf_counter()
    await control.say("take")
    await control.notice("refused")
    return time.perf_counter() - started


async def test_flooding_client_is_closed_without_effect_on_others(server: AppServer) -> None:
    async with opened(server.url) as (good, control):
        await control.say("take")
        await control.wait(mine=True)
        async with opened(server.url) as (bad, _):
            camera = msgspec.msgpack.encode({"type": "GuiUpdateMessage"})

            async def flood() -> None:
                with suppress(ConnectionClosed):
                    while True:
                        await bad.socket.send(camera)
                        await asyncio.sleep(0)

            flooding = asyncio.create_task(flood())
            trips = [await round_trip(control) for _ in range(10)]
            async with asyncio.timeout(10.0):
                await flooding
            assert bad.socket.close_code == 1008
        assert sorted(trips)[5] < 0.1
        heard = await moves_the_arm(good, 2.0)
        assert any(m["type"] == "SetOrientationMessage" for m in heard)


async def test_large_message_is_refused(server: AppServer) -> None:
    async with peers(server.url) as (bad, good):
        with suppress(ConnectionClosed):
            await bad.set("1 base turn", value="x" * 10 * MAX_MESSAGE_BYTES)
            await bad.listen(5.0)
        assert bad.socket.close_code == 1009
        assert await good.listen(BRIEF) == []
    async with controlling(server.url) as control:
        await control.say("stop", because="x" * 100_000)
        async with asyncio.timeout(5.0):
            await control.socket.wait_closed()
    assert state_of(server)["stopped"] is None


async def test_client_that_never_reads_does_not_delay_others(server: AppServer) -> None:
    async with opened(server.url) as (good, control), AsyncExitStack() as stack:
        await control.say("take")
        for _ in range(4):
            cookie, page = enter(server.url), page_name()
            narrow = socket.create_connection(("127.0.0.1", server.port))
            narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            bad = await stack.enter_async_context(
                websocket(
                    server.url,
                    f"/viser?page={page}",
                    cookie,
                    sock=narrow,
                    max_queue=1,
                    subprotocols=[SUBPROTOCOL],
                )
            )
            bad.transport.pause_reading()
        for degrees in (5.0, 0.0):
            started = time.perf_counter()
            heard = await moves_the_arm(good, degrees)
            assert any(m["type"] == "SetOrientationMessage" for m in heard)
            assert time.perf_counter() - started < 3.0 + QUIET


BRIEF = 0.1
"""Time [s] in which the next frame arrives: six periods of the view."""


@asynccontextmanager
async def peers(url: str) -> AsyncIterator[tuple[Peer, Peer]]:
    """Open a hostile page and one that watches."""
    async with opened(url) as (bad, _), opened(url) as (good, _):
        yield bad, good


async def moves_the_arm(good: Peer, degrees: float) -> list[dict[str, Any]]:
    """Turn axis 1, and return what ``good`` hears of it until nothing more comes."""
    await good.set("1 base turn", value=degrees)
    heard: list[dict[str, Any]] = []
    async with asyncio.timeout(20.0):
        while not any(message["type"] == "SetOrientationMessage" for message in heard):
            heard += await good.listen()
    return heard
