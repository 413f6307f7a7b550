"""Test that load does not delay STOP: silent connections, half requests, floods of questions."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack, suppress
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosedError

from katana450.extensions.importers.uploads import WAITING, WAITING_EACH
from katana450.server.web.acceptor import WAITING_TIMEOUT
from katana450.server.web.admission import LIMIT_CLOSE_CODE, SOCKETS_EACH
from katana450.server.web.bodies import BODY_SECONDS
from tests.browser.server import APP, ROOT, AppServer
from tests.gateway.attack import FEW_DESCRIPTORS, answered, asking, closed, silent, stop_seconds
from tests.gateway.client import ask, controlling, enter, websocket
from tests.gateway.lines import Lines

SOON = 1.0
"""Maximum delay of STOP [s]. It takes a hundredth of this, but more on a busy machine."""

SILENT = 1100
"""Number of connections, more than the open files that the server may have."""


@pytest.fixture(scope="module")
def tokens(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the token of a link for each role, and under ``file`` the access file."""
    file = tmp_path_factory.mktemp("access") / "access.json"
    found = {"file": str(file)}
    for name in ("viewer", "operator", "other"):
        role = "viewer" if name == "viewer" else "operator"
        command = ["access", "give", "--file", str(file), "--name", name, "--role", role]
        output = subprocess.run(
            [sys.executable, "-m", "katana450", *command],
            cwd=ROOT, capture_output=True, text=True, check=True, timeout=60,
        ).stdout  # fmt: skip
        found[name] = output.partition("#")[2].strip()
    return found


@pytest.fixture(scope="module")
def guarded(tokens: dict[str, str]) -> Iterator[AppServer]:
    """Start a server that requires links and may have 1024 open files."""
    with AppServer((*FEW_DESCRIPTORS, "--access", tokens["file"])) as server:
        yield server


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    """Start a server that requires no links."""
    with AppServer((*APP, "--lines", "0")) as server:
        yield server


def test_silent_connections_do_not_delay_stop(guarded: AppServer, tokens: dict[str, str]) -> None:
    cookie = enter(guarded.url, tokens["operator"])

    async def act() -> None:
        async with controlling(guarded.url, cookie) as control:
            await control.wait()
            task = asyncio.create_task(stop_seconds(control, 60))
            with silent(guarded.port, 0) as _:
                pass
            # They connect in a thread, so that the event loop of this test is not blocked.
            holding = silent(guarded.port, SILENT)
            await asyncio.to_thread(holding.__enter__)
            try:
                took = await task + await stop_seconds(control, 20)
            finally:
                holding.__exit__(None, None, None)
            assert max(took) < SOON

    asyncio.run(act())
    # The log has a line now and then, and no traceback for each connection.
    assert len(guarded.output.splitlines()) < 100, guarded.output
    assert "Traceback" not in guarded.output


@pytest.mark.long
def test_new_clients_are_served_among_silent_ones(
    guarded: AppServer, tokens: dict[str, str]
) -> None:
    cookie = enter(guarded.url, tokens["operator"])
    with silent(guarded.port, SILENT):
        for _ in range(5):
            began = time.monotonic()
            status, _, body = ask(
                f"{guarded.url}/stop", data=b"", Origin=guarded.url, Cookie=cookie
            )
            assert (status, body) == (204, b"")
            assert ask(f"{guarded.url}/health")[0] == 200
            assert time.monotonic() - began < 2.0 * SOON


@pytest.mark.long
def test_half_requests_are_closed_and_slow_bodies_refused(server: AppServer) -> None:
    head = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n".encode()
    upgrade = head.replace(b"/ ", b"/api/v1/socket ") + b"Upgrade: websocket\r\n"
    body = (
        f"POST /enter HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nOrigin: {server.url}\r\n"
        "Content-Length: 20\r\n\r\n{"
    ).encode()
    with (
        silent(server.port, 3) as nothing,
        silent(server.port, 3, head) as half,
        silent(server.port, 3, upgrade) as handshakes,
        silent(server.port, 3, head + b"\r\n") as idle,
        silent(server.port, 3, body) as slow,
    ):
        everybody = [*nothing, *half, *handshakes, *idle, *slow]
        assert closed(everybody, 3.0 * WAITING_TIMEOUT) == len(everybody)


@pytest.mark.long
def test_slow_body_is_refused(server: AppServer) -> None:
    head = f"POST /enter HTTP/1.1\r\nHost: x\r\nOrigin: {server.url}\r\nContent-Length: 20\r\n\r\n"
    request = head.replace("Host: x", f"Host: 127.0.0.1:{server.port}").encode()
    with silent(server.port, 1, request) as (slow,):
        slow.settimeout(4.0 * BODY_SECONDS)
        answer = slow.recv(4096)
    assert answer.startswith(b"HTTP/1.1 408 ")


def test_flood_of_questions_is_refused_and_does_not_delay_stop(
    guarded: AppServer, tokens: dict[str, str]
) -> None:
    cookie = enter(guarded.url, tokens["operator"])

    async def act() -> tuple[list[float], Counter[str]]:
        async with controlling(guarded.url, cookie) as control:
            await control.wait()
            async with asking(guarded.url, 30, 390.0, token=tokens["viewer"]) as heard:
                await asyncio.sleep(1.0)
                return await stop_seconds(control, 40), heard

    took, heard = asyncio.run(act())
    assert took[-1] < SOON
    assert heard["answered"] > 0
    assert heard["refused"] > 0


def test_refusal_states_when_to_retry(server: AppServer) -> None:
    async def act() -> dict[str, Any]:
        async with AsyncExitStack() as stack:
            path = "/api/v1/socket?name=Flood"
            lines = [
                await stack.enter_async_context(websocket(server.url, path, max_queue=None))
                for _ in range(3)
            ]
            # Each connection sends no more than its rate limit allows.
            for _ in range(700):
                for line in lines:
                    await line.send('{"do": "query","at":"world"}')
            while True:
                for line in lines:
                    heard: dict[str, Any] = json.loads(await asyncio.wait_for(line.recv(), 5.0))
                    if heard["is"] == "refused":
                        return heard

    refused = asyncio.run(act())
    assert refused["retry"] > 0.0
    assert "Try again in" in refused["why"]


def test_http_questions_take_from_the_same_budget(server: AppServer) -> None:
    def flood(_number: int) -> dict[str, str]:
        """Return the headers of the first refusal."""
        for _ in range(2000):
            status, headers, _ = ask(f"{server.url}/api/v1/world")
            if status == 429:
                return headers
        raise AssertionError("nothing was refused")

    with ThreadPoolExecutor(4) as pool:
        for headers in pool.map(flood, range(4)):
            assert int(headers["retry-after"]) >= 1
    assert ask(f"{server.url}/api/v1/stop", data=b"", Origin=server.url)[0] == 204


def test_one_identity_cannot_take_all_sockets(guarded: AppServer, tokens: dict[str, str]) -> None:
    async def act() -> int:
        async with AsyncExitStack() as stack:
            headers = {"Authorization": f"Bearer {tokens['other']}"}
            opened = 0
            with suppress(ConnectionClosedError):
                while opened <= SOCKETS_EACH:
                    line = websocket(guarded.url, "/api/v1/socket?name=Many", headers=headers)
                    await (await stack.enter_async_context(line)).recv()
                    opened += 1
            assert line.connection.close_code == LIMIT_CLOSE_CODE
            cookie = enter(guarded.url, tokens["operator"])
            async with controlling(guarded.url, cookie) as control:
                await control.wait()
            return opened

    assert asyncio.run(act()) == SOCKETS_EACH


def test_one_identity_cannot_take_all_uploads(guarded: AppServer, tokens: dict[str, str]) -> None:
    head = (
        f"POST /api/v1/mesh?name=a.stl HTTP/1.1\r\nHost: 127.0.0.1:{guarded.port}\r\n"
        f"Authorization: Bearer {tokens['operator']}\r\nContent-Length: 100\r\n\r\nx"
    ).encode()
    with silent(guarded.port, WAITING, head) as dripping:
        # Connections beyond the limit are refused; the others keep their places for a while.
        assert answered(dripping, 0.3 * BODY_SECONDS) == WAITING - WAITING_EACH
        status, _, body = ask(
            f"{guarded.url}/api/v1/mesh?name=b.stl",
            data=b"no mesh",
            Authorization=f"Bearer {tokens['other']}",
        )
        assert status == 422, body


def test_silent_tcp_connections_do_not_block_programs(server: AppServer) -> None:
    port = Lines.port(server)
    with silent(port, 64):
        lines = Lines(server)
        with lines.socket, lines.reader:
            lines.say(do="hello", name="x")
            assert lines.hear()["is"] == "welcome"
