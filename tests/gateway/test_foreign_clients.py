"""Test clients that are not signed in or come from another site: they get nothing."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from tests.browser.server import AppServer
from tests.gateway.client import (
    SUBPROTOCOL,
    ask,
    enter,
    opened,
    page_name,
    websocket,
)
from tests.gateway.lines import Lines


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


def test_client_without_a_session_gets_no_scene(server: AppServer) -> None:
    opening = websocket(server.url, f"/viser?page={page_name()}", subprotocols=[SUBPROTOCOL])
    assert refusal(opening) == 403
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
    (port,) = {*ports} - {server.port, Lines.port(server)}
    return port


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="ports are read from /proc")
@pytest.mark.parametrize(
    "headers",
    [{"X-Katana450-Key": "x" * 43}, pytest.param({}, marks=pytest.mark.long)],
    ids=["a wrong key", "no key"],
)
def test_viser_accepts_only_the_gateway(server: AppServer, headers: dict[str, str]) -> None:
    port = viser_port(server)

    async def knock() -> tuple[list[Any], int | None]:
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
            heard, code = await knock()
            assert code == 1008
            assert heard == []
            assert await good.listen() == []

    asyncio.run(watch())


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
