"""Test clients that send too much or never read: they do not delay others."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from contextlib import AsyncExitStack, suppress
from typing import Any

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed

from katana450.server.web.security import MAX_MESSAGE_BYTES
from tests.browser.server import AppServer
from tests.gateway.client import (
    QUIET,
    SUBPROTOCOL,
    ask,
    controlling,
    enter,
    opened,
    page_name,
    websocket,
)
from tests.gateway.hostile import BRIEF, moves_the_arm, peers


@pytest.mark.long
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
    assert "sent too many invalid messages" in server.output
    assert "Traceback" not in server.output


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
                trips = [await round_trip(control) for _ in range(10)]
                async with asyncio.timeout(10.0):
                    await flooding
            assert sorted(trips)[5] < 0.1
            heard = await moves_the_arm(good, 2.0)
            assert any(m["type"] == "SetOrientationMessage" for m in heard)

    asyncio.run(attack())


def test_large_message_is_refused(server: AppServer) -> None:
    async def attack() -> None:
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

    asyncio.run(attack())
    assert json.loads(ask(f"{server.url}/api/v1/state")[2])["stopped"] is None


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
            for degrees in (5.0, 0.0):
                started = time.perf_counter()
                heard = await moves_the_arm(good, degrees)
                assert any(m["type"] == "SetOrientationMessage" for m in heard)
                assert time.perf_counter() - started < 3.0 + QUIET

    asyncio.run(attack())
