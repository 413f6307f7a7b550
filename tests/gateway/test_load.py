"""Test that silent connections delay neither STOP nor programs; questions have a budget."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median

from katana450.arm.control.lease import Role
from tests.browser.server import APP, AppServer
from tests.gateway.client import Control, controlling
from tests.gateway.site import open_site
from tests.gateway.virtual import VirtualServer

SOON = 1.0
"""Maximum of the median delay of STOP [s]. It takes a hundredth of this; single ones of a busy
machine, on which also this process waits, do not count."""

SILENT = 1100
"""Number of connections, more than the open files that the server may have."""


FEW_DESCRIPTORS = ("sh", "-c", 'ulimit -n 1024; exec "$0" "$@"', *APP)
"""Command of a server with a limit of open files, which it cannot raise itself."""


@contextmanager
def silent(port: int, count: int) -> Iterator[None]:
    """Open ``count`` connections that send nothing."""
    sockets: list[socket.socket] = []
    try:
        for _ in range(count):
            connection = socket.socket()
            sockets.append(connection)
            connection.settimeout(2.0)
            with suppress(OSError):
                connection.connect(("127.0.0.1", port))
        yield
    finally:
        for connection in sockets:
            connection.close()


async def stop_seconds(control: Control, times: int, seconds: float = 30.0) -> list[float]:
    """Return the sorted delays [s] of the answers to ``times`` presses of STOP."""
    took = []
    for _ in range(times):
        pressed = time.perf_counter()
        await control.say("stop")
        await control.notice("stopped", seconds)
        took.append(time.perf_counter() - pressed)
        await asyncio.sleep(0.05)
    return sorted(took)


def test_silent_connections_do_not_delay_stop(tmp_path: Path) -> None:
    async def act(server: AppServer, cookie: str) -> None:
        async with controlling(server.url, cookie) as control:
            await control.wait()
            task = asyncio.create_task(stop_seconds(control, 20))
            # They connect in a thread, so that the event loop of this test is not blocked.
            holding = silent(server.port, SILENT)
            await asyncio.to_thread(holding.__enter__)
            try:
                took = await task + await stop_seconds(control, 10)
            finally:
                holding.__exit__(None, None, None)
            assert median(took) < SOON

    with open_site(tmp_path, command=FEW_DESCRIPTORS) as site:
        asyncio.run(act(site.server, site.cookie(Role.OPERATOR)))
        # The log has a line now and then, and no traceback for each connection.
        assert len(site.server.output.splitlines()) < 100, site.server.output
        assert "Traceback" not in site.server.output


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


def test_codes_for_phones_are_limited(local: VirtualServer) -> None:
    assert {local.ask("/api/v1/phone")[0] for _ in range(20)} == {200, 429}
