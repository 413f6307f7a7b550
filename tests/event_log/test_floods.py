"""Test that requests and connections refused by a limit are in the log, with their sender."""

from __future__ import annotations

import asyncio
import socket
import time
from contextlib import AsyncExitStack, ExitStack, suppress
from pathlib import Path

from websockets.exceptions import ConnectionClosedError

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from katana450.server.web.admission import (
    REQUESTS_EACH,
    SOCKETS_EACH,
    TOO_MANY_REQUESTS,
    TOO_MANY_SOCKETS,
)
from katana450.server.web.program_socket import LINES_EACH
from tests.browser.server import APP, AppServer
from tests.event_log.logs import records
from tests.gateway.client import HOUR, ask, websocket
from tests.gateway.lines import Lines
from tests.waiting import until


async def many_sockets(url: str, token: str) -> None:
    async with AsyncExitStack() as stack:
        headers = {"Authorization": f"Bearer {token}"}
        with suppress(ConnectionClosedError):
            for _ in range(SOCKETS_EACH + 1):
                line = websocket(url, "/api/v1/socket?name=Many", headers=headers)
                await (await stack.enter_async_context(line)).recv()


def many_lines(server: AppServer, token: str) -> None:
    with ExitStack() as stack:
        for _ in range(LINES_EACH + 1):
            lines = Lines(server)
            stack.enter_context(lines.socket)
            stack.enter_context(lines.reader)
            lines.say(do="hello", name="Liner", token=token)
            lines.hear()


def many_requests(server: AppServer, token: str) -> None:
    """Begin as many requests as are allowed at once, and one more, which is refused."""
    head = (
        f"POST /api/v1/do HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Authorization: Bearer {token}\r\nX-Program: {'k' * 16}\r\nContent-Length: 9\r\n\r\n"
    )
    with ExitStack() as stack:
        for _ in range(REQUESTS_EACH):
            # Its body never comes.
            request = socket.create_connection(("127.0.0.1", server.port))
            stack.enter_context(request).sendall(head.encode())

        def is_refused() -> bool:
            return ask(f"{server.url}/api/v1/world", Authorization=f"Bearer {token}")[0] == 429

        until(is_refused)


def test_refusals_by_limits_name_their_sender(tmp_path: Path) -> None:
    access = AccessFile.create(tmp_path / "access.json")
    token = access.give("Vera", Role.VIEWER, time.time() + HOUR)
    options = ("--lines", "0", "--access", str(access.path), "--log", str(tmp_path / "log"))
    with AppServer((*APP, *options)) as server:
        asyncio.run(many_sockets(server.url, token))
        many_lines(server, token)
        many_requests(server, token)
    log = [row for row in records(tmp_path / "log") if row["kind"] == "refusal"]
    refusals = {(row["what"]["request"], row["who"]["channel"], row["why"]) for row in log}
    assert ("connection", "websocket", TOO_MANY_SOCKETS) in refusals
    assert any(what == "connection" and channel == "TCP" for what, channel, _ in refusals)
    assert ("request", "HTTP", TOO_MANY_REQUESTS) in refusals
    assert {row["who"]["address"] for row in log} == {"127.0.0.1"}
    assert {row["who"]["name"].partition(",")[0] for row in log} == {"Vera"}
