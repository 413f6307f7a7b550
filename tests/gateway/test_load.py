"""Test that load does not delay STOP: silent connections, half requests, floods of questions."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Iterator
from statistics import median

import pytest

from katana450.arm.control.lease import Role
from katana450.server.web.acceptor import WAITING_TIMEOUT
from katana450.server.web.access_links import AccessFile
from tests.browser.server import AppServer
from tests.gateway.attack import FEW_DESCRIPTORS, asking, closed, silent, stop_seconds
from tests.gateway.client import HOUR, controlling, enter
from tests.gateway.lines import Lines
from tests.gateway.virtual import VirtualServer

SOON = 1.0
"""Maximum of the median delay of STOP [s]. It takes a hundredth of this; single ones of a busy
machine, on which also this process waits, do not count."""

SILENT = 1100
"""Number of connections, more than the open files that the server may have."""


@pytest.fixture(scope="module")
def tokens(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the token of a link for each role, and under ``file`` the access file."""
    file = AccessFile.create(tmp_path_factory.mktemp("access") / "access.json")
    ends = time.time() + HOUR
    tokens = {role.value: file.give(role.value, role, ends) for role in Role}
    return {"file": str(file.path), **tokens}


@pytest.fixture(scope="module")
def guarded(tokens: dict[str, str]) -> Iterator[AppServer]:
    """Start a server that requires links and may have 1024 open files."""
    with AppServer((*FEW_DESCRIPTORS, "--access", tokens["file"])) as server:
        yield server


def test_silent_connections_do_not_delay_stop(guarded: AppServer, tokens: dict[str, str]) -> None:
    cookie = enter(guarded.url, tokens["operator"])

    async def act() -> None:
        async with controlling(guarded.url, cookie) as control:
            await control.wait()
            task = asyncio.create_task(stop_seconds(control, 20))
            with silent(guarded.port, 0) as _:
                pass
            # They connect in a thread, so that the event loop of this test is not blocked.
            holding = silent(guarded.port, SILENT)
            await asyncio.to_thread(holding.__enter__)
            try:
                took = await task + await stop_seconds(control, 10)
            finally:
                holding.__exit__(None, None, None)
            assert median(took) < SOON

    asyncio.run(act())
    # The log has a line now and then, and no traceback for each connection.
    assert len(guarded.output.splitlines()) < 100, guarded.output
    assert "Traceback" not in guarded.output


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
def test_flood_of_questions_is_refused_and_does_not_delay_stop(
    guarded: AppServer, tokens: dict[str, str]
) -> None:
    cookie = enter(guarded.url, tokens["operator"])

    async def act() -> tuple[list[float], Counter[str]]:
        async with controlling(guarded.url, cookie) as control:
            await control.wait()
            async with asking(guarded.url, 30, 390.0, token=tokens["viewer"]) as heard:
                await asyncio.sleep(1.0)
                return await stop_seconds(control, 20), heard

    took, heard = asyncio.run(act())
    assert median(took) < SOON
    assert heard["answered"] > 0
    assert heard["refused"] > 0


def test_http_questions_take_from_the_same_budget(local: VirtualServer) -> None:
    async def flood() -> dict[str, str]:
        """Return the headers of the first refusal."""
        for _ in range(20_000):
            status, headers, _ = await local.request("/api/v1/world")
            if status == 429:
                return headers
        raise AssertionError("nothing was refused")

    assert int(local.run(flood())["retry-after"]) >= 1
    assert local.ask("/api/v1/stop", data=b"")[0] == 204


def test_silent_tcp_connections_do_not_block_programs(server: AppServer) -> None:
    port = Lines.port(server)
    with silent(port, 64):
        lines = Lines(server)
        with lines.socket, lines.reader:
            lines.say(do="hello", name="x")
            assert lines.hear()["is"] == "welcome"
