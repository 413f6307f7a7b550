"""Test hostile clients: their messages change nothing and harm no other client.

The other browser is a raw client too, so that the messages to it can be compared byte for byte.
"""

from __future__ import annotations

import asyncio
import json
import math
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from katana450.server.viser_bridge.message_filter import MAX_MESSAGE_BYTES
from katana450.server.viser_bridge.proxy import MAX_BROWSERS, MAX_BROWSERS_EACH
from katana450.settings import Settings
from tests.browser.server import ATTENTIVE_APP, BARE_APP, AppServer
from tests.gateway.client import (
    QUIET,
    SUBPROTOCOL,
    UPRIGHT,
    Peer,
    ask,
    controlling,
    enter,
    opened,
    page_name,
    websocket,
)

BRIEF = 0.1
"""Time [s] in which the next frame arrives: six periods of the view."""

Attack = Callable[[Peer], Any]

GIZMO = {"type": "TransformControlsUpdateMessage", "name": "/target/move", "owner": ""}


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer() as server:
        yield server


async def drag(peer: Peer, wxyz: list[float], position: list[float], **changed: str) -> None:
    """Grab a gizmo, and drag it to a pose."""
    which = {"name": GIZMO["name"], "owner": "", **changed}
    await peer.say(type="TransformControlsDragStartMessage", **which)
    await peer.say(**(which | {"type": GIZMO["type"], "wxyz": wxyz, "position": position}))


@asynccontextmanager
async def peers(url: str) -> AsyncIterator[tuple[Peer, Peer]]:
    """Open a hostile page and one that watches."""
    async with opened(url) as (bad, _), opened(url) as (good, _):
        yield bad, good


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


async def moves_the_arm(good: Peer, degrees: float) -> list[dict[str, Any]]:
    await good.set("Axis 1", value=degrees)
    return await good.listen()


def test_message_that_no_page_sends_changes_nothing(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (bad, good):
            for name, send in ATTACKS.items():
                await send(bad)
                assert await good.listen(BRIEF) == [], name
            assert await good.listen() == []

    asyncio.run(attack())


def test_invalid_message_is_not_answered(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (_, good):
            # On a busy machine the scene arrives with pauses.
            await good.listen(1.0)
            for name, send in RUDE.items():
                async with opened(server.url) as (bad, _):
                    with suppress(ConnectionClosed):
                        await send(bad)
                        await bad.listen(BRIEF)
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


def test_closed_browser_receives_no_more_frames(server: AppServer) -> None:
    """Each browser is closed while the scene is being sent to it."""

    async def knock(cookie: str) -> None:
        path = f"/viser?page={page_name()}"
        with suppress(ConnectionClosed):
            async with websocket(server.url, path, cookie, subprotocols=[SUBPROTOCOL]) as bad:
                for _ in range(200):
                    await bad.send(b"\xff")
                await asyncio.wait_for(bad.wait_closed(), 10.0)

    async def crowd() -> None:
        cookie = enter(server.url)
        for _ in range(40):
            await asyncio.gather(*(knock(cookie) for _ in range(8)))

    asyncio.run(crowd())
    assert server.running
    assert "sent too much" in server.output
    assert "Traceback" not in server.output


def test_arm_obeys_a_valid_browser_after_the_attacks(server: AppServer) -> None:
    async def obey() -> None:
        async with opened(server.url) as (bad, _), opened(server.url) as (good, control):
            await control.say("take")
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
            await bad.set("Axis 1", value=30.0)
            (truth,) = [m for m in await bad.listen() if m["type"] == "GuiUpdateMessage"]
            assert truth["updates"] == {"value": 12.5}
            assert await good.listen(BRIEF) == []
            await moves_the_arm(good, 0.0)

    asyncio.run(obey())
    assert server.running
    assert "Dropped a GuiUpdateMessage" in server.output


def test_attack_without_the_guard_would_do_harm() -> None:
    """Without the guard, viser lets the same message disable a control for all browsers."""

    @asynccontextmanager
    async def bare_peers(url: str) -> AsyncIterator[tuple[Peer, Peer]]:
        async with (
            websocket(url, "/", subprotocols=[SUBPROTOCOL]) as bad,
            websocket(url, "/", subprotocols=[SUBPROTOCOL]) as good,
        ):
            pair = Peer(bad), Peer(good)
            for peer in pair:
                await peer.learn()
            yield pair

    async def attack(url: str) -> list[dict[str, Any]]:
        async with bare_peers(url) as (bad, good):
            await good.set("Axis 1", value=10.0)
            assert await good.listen()
            await bad.set("Axis 1", removed=True)
            await good.listen()
            await good.set("Axis 1", value=20.0)
            return await good.listen()

    with AppServer(BARE_APP) as bare:
        assert asyncio.run(attack(bare.url)) == []


# Clients that are not signed in


def refusal(opening: connect) -> int:
    """Return the status with which a websocket is refused."""

    async def knock() -> int:
        with pytest.raises(InvalidStatus) as refused:
            async with opening:
                pass
        return refused.value.response.status_code

    return asyncio.run(knock())


@pytest.mark.parametrize("path", ["/viser?page=", "/control?page="])
@pytest.mark.parametrize("origin", ["https://evil.example", "http://127.0.0.1:1", "null", None])
def test_page_of_another_site_opens_no_socket(
    server: AppServer, path: str, origin: str | None
) -> None:
    cookie = enter(server.url)
    opening = websocket(
        server.url, path + page_name(), cookie, origin=origin, subprotocols=[SUBPROTOCOL]
    )
    assert refusal(opening) == 403


def test_page_of_another_site_posts_nothing(server: AppServer) -> None:
    cookie = enter(server.url)
    for path in ("/stop", "/enter"):
        for headers in ({}, {"Origin": "https://evil.example"}):
            status, _, _ = ask(f"{server.url}{path}", data=b"{}", Cookie=cookie, **headers)
            assert status == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "[", "10.0.0.1"])
def test_foreign_host_name_is_refused(server: AppServer, host: str) -> None:
    status, _, body = ask(f"{server.url}/", Host=host)
    assert status in (400, 403)
    assert b"katana" not in body.lower()


def test_client_without_a_session_gets_no_scene(server: AppServer) -> None:
    opening = websocket(server.url, f"/viser?page={page_name()}", subprotocols=[SUBPROTOCOL])
    assert refusal(opening) == 403
    assert ask(f"{server.url}/viser/")[0] == 401
    assert ask(f"{server.url}/stop", data=b"", Origin=server.url)[0] == 401

    async def knock() -> int | None:
        async with websocket(server.url, f"/control?page={page_name()}") as socket:
            with suppress(ConnectionClosed):
                await socket.recv()
            return socket.close_code

    assert asyncio.run(knock()) == 4401


def viser_port(server: AppServer) -> int:
    """Return the other port on which the front end listens."""
    inodes = {
        link.readlink().name.partition("[")[2].rstrip("]")
        for link in Path(f"/proc/{server.front}/fd").iterdir()
        if link.readlink().name.startswith("socket:")
    }
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    ports = [int(row[1][9:], 16) for row in rows if row[3] == "0A" and row[9] in inodes]
    (port,) = [port for port in ports if port != server.port]
    return port


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="ports are read from /proc")
def test_viser_accepts_only_the_gateway(server: AppServer) -> None:
    port = viser_port(server)

    async def knock(**headers: str) -> tuple[list[Any], int | None]:
        heard = []
        async with connect(
            f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], additional_headers=headers
        ) as socket:
            with suppress(ConnectionClosed):
                # Sent before the close, so that the answer can already be read.
                for _ in range(50):
                    await socket.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
                while True:
                    heard.append(await socket.recv())
            return heard, socket.close_code

    async def watch() -> None:
        async with opened(server.url) as (good, _):
            for headers in ({}, {"X-Katana450-Key": "x" * 43}):
                heard, code = await knock(**headers)
                assert code == 1008
                assert heard == []
            assert await good.listen() == []

    asyncio.run(watch())


# Clients that send too much


async def round_trip(control: Any) -> float:
    """Return the time [s] from a request to the status that it causes."""
    started = time.perf_counter()
    await control.say("take")
    await control.notice("refused")
    return time.perf_counter() - started


def test_flooding_client_is_closed_without_effect_on_others(server: AppServer) -> None:
    async def attack() -> None:
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
                trips = [await round_trip(control) for _ in range(20)]
                async with asyncio.timeout(10.0):
                    await flooding
            assert sorted(trips)[10] < 0.1
            heard = await moves_the_arm(good, 2.0)
            assert any(m["type"] == "SetOrientationMessage" for m in heard)

    asyncio.run(attack())


def test_large_message_is_refused(server: AppServer) -> None:
    async def attack() -> None:
        async with peers(server.url) as (bad, good):
            with suppress(ConnectionClosed):
                await bad.set("Axis 1", value="x" * 10 * MAX_MESSAGE_BYTES)
                await bad.listen(5.0)
            assert bad.socket.close_code == 1009
            assert await good.listen(BRIEF) == []
        async with controlling(server.url) as control:
            await control.say("stop", because="x" * 100_000)
            async with asyncio.timeout(5.0):
                await control.socket.wait_closed()

    asyncio.run(attack())
    assert json.loads(ask(f"{server.url}/api/v1/state")[2])["stopped"] is None


@pytest.mark.parametrize(
    "text",
    [
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
        b"\x00\x01",
    ],
)
def test_invalid_request_changes_nothing(server: AppServer, text: str | bytes) -> None:
    async def attack() -> None:
        async with controlling(server.url) as watching, controlling(server.url) as control:
            await watching.wait(windows=2, mood="ok", holder=None)
            before = watching.status
            for _ in range(10):
                with suppress(ConnectionClosed):
                    await control.socket.send(text)
            async with asyncio.timeout(5.0):
                await control.socket.wait_closed()
            after = await watching.wait(windows=1)
            assert before | {"windows": 1, "others": []} == after | {"others": []}

    asyncio.run(attack())


def test_browser_with_false_acknowledgements_is_closed(server: AppServer) -> None:
    async def lie(count: Any) -> int | None:
        async with opened(server.url) as (bad, _):
            await bad.say(type="Seen", count=count)
            with suppress(ConnectionClosed):
                await bad.listen()
            return bad.socket.close_code

    for count in (-1, 10**6, 2**60):
        assert asyncio.run(lie(count)) == 1008
    # A value that is not a count is an invalid message.
    assert asyncio.run(lie("all")) is None


def test_client_that_never_reads_does_not_delay_others(server: AppServer) -> None:
    async def attack() -> None:
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
            for degrees in (5.0, 10.0, 0.0):
                started = time.perf_counter()
                heard = await moves_the_arm(good, degrees)
                assert any(m["type"] == "SetOrientationMessage" for m in heard)
                assert time.perf_counter() - started < 3.0 + QUIET

    asyncio.run(attack())


def test_hanging_page_of_the_driver_causes_a_stop_in_time() -> None:
    async def hang(url: str) -> list[float]:
        took = []
        async with opened(url) as (peer, control):
            await control.say("take")
            await control.wait(mine=True)
            for degrees in (165.0, -170.0, 165.0):
                await peer.set("Axis 1", value=degrees)
                await control.wait(mood="moving")
                control.alive = False
                await control.wait(mood="stopped")
                took.append(time.perf_counter() - control.last_beat)
                control.alive = True
                await control.say("clear_stop")
                await control.wait(stopped=None)
                assert await peer.listen()
        return took

    with AppServer(ATTENTIVE_APP) as server:
        took = asyncio.run(hang(server.url))
    # A status is sent every tenth of a second.
    assert min(took) >= Settings.silence
    assert min(took) < Settings.silence + 0.2


@pytest.mark.long
def test_number_of_browsers_is_limited() -> None:
    async def crowd(server: AppServer) -> None:
        async with opened(server.url) as (good, _), AsyncExitStack() as stack:
            found_room: list[object] = []

            async def crowd_in(maximum: int) -> None:
                cookie, before = enter(server.url), len(found_room)
                while len(found_room) <= before + maximum:
                    path = f"/viser?page={page_name()}"
                    line = websocket(server.url, path, cookie, subprotocols=[SUBPROTOCOL])
                    found_room.append(await stack.enter_async_context(line))

            while len(found_room) < MAX_BROWSERS - MAX_BROWSERS_EACH:
                before = len(found_room)
                with pytest.raises(InvalidStatus) as refused:
                    await crowd_in(MAX_BROWSERS_EACH)
                assert refused.value.response.status_code == 403
                assert len(found_room) - before == MAX_BROWSERS_EACH
            with pytest.raises(InvalidStatus):
                await crowd_in(MAX_BROWSERS_EACH)
            # On a slow machine a connection that is still closing may hold its place.
            assert MAX_BROWSERS - 3 <= len(found_room) <= MAX_BROWSERS - 1
            assert await moves_the_arm(good, 3.0)

    with AppServer() as server:
        asyncio.run(crowd(server))


@pytest.mark.parametrize(
    "query",
    [
        "?websocket=ws://evil.example",
        "?websocket=wss://127.0.0.1",
        "?websocket=ws://{host}&websocket=ws://evil.example",
        "?playbackPath=https://evil.example/x.viser",
        "?playbackPath=",
    ],
)
def test_page_of_viser_is_not_redirected(server: AppServer, query: str) -> None:
    cookie = enter(server.url)
    host = server.url.removeprefix("http://")
    assert ask(f"{server.url}/viser/{query.format(host=host)}", Cookie=cookie)[0] == 400
    assert ask(f"{server.url}/viser/?websocket=ws://{host}/viser", Cookie=cookie)[0] == 200


def test_every_response_has_security_headers(server: AppServer) -> None:
    cookie = enter(server.url)
    for path in ("/", "/viser/", "/static/page.js", "/nowhere", "/api/v1/state"):
        _, headers, _ = ask(server.url + path, Cookie=cookie)
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert "server" not in headers
    for path in ("/", "/viser/"):
        policy = ask(server.url + path, Cookie=cookie)[1]["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "connect-src 'self'" in policy
        scripts = policy.partition("script-src ")[2].partition(";")[0]
        assert "unsafe-inline" not in scripts
        assert "'unsafe-eval'" not in scripts


@pytest.mark.parametrize(
    "path", ["/static/../app/katana450/cli/main.py", "/static/%2e%2e/pyproject.toml"]
)
def test_no_other_file_is_served(server: AppServer, path: str) -> None:
    assert ask(server.url + path)[0] == 404
