"""Test that requests and connections refused by a limit are in the log, with their sender."""

from __future__ import annotations

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor
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

REFUSAL_SECONDS = 30.0
"""Maximum time until one of many requests at once is refused; a busy client asks slowly."""


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


def many_reads(url: str, token: str) -> None:
    """Read in many threads until a request is refused."""
    refused = threading.Event()
    end = time.monotonic() + REFUSAL_SECONDS

    def read(_: int) -> None:
        while not refused.is_set() and time.monotonic() < end:
            # A surplus connection can be cut before its request is read.
            with suppress(ConnectionError):
                if ask(f"{url}/api/v1/world", Authorization=f"Bearer {token}")[0] == 429:
                    refused.set()

    with ThreadPoolExecutor(2 * REQUESTS_EACH) as pool:
        list(pool.map(read, range(2 * REQUESTS_EACH)))
    assert refused.is_set()


def test_refusals_by_limits_name_their_sender(tmp_path: Path) -> None:
    access = AccessFile.create(tmp_path / "access.json")
    token = access.give("Vera", Role.VIEWER, time.time() + HOUR)
    options = ("--lines", "0", "--access", str(access.path), "--log", str(tmp_path / "log"))
    with AppServer((*APP, *options)) as server:
        asyncio.run(many_sockets(server.url, token))
        many_lines(server, token)
        many_reads(server.url, token)
    found = [each for each in records(tmp_path / "log") if each["kind"] == "refusal"]
    told = {(each["what"]["request"], each["who"]["channel"], each["why"]) for each in found}
    assert ("connection", "websocket", TOO_MANY_SOCKETS) in told
    assert any(what == "connection" and channel == "TCP" for what, channel, _ in told)
    floods = [why for what, _, why in told if what != "connection"]
    assert any(why == TOO_MANY_REQUESTS or "send too many requests" in why for why in floods)
    assert {each["who"]["address"] for each in found} == {"127.0.0.1"}
    assert {each["who"]["name"].partition(",")[0] for each in found} == {"Vera"}
