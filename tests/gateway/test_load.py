"""Test that silent connections delay neither STOP nor programs; questions have a budget."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from statistics import median

import pytest

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, AppServer
from tests.gateway.client import HOUR, Control, controlling, enter
from tests.gateway.virtual import VirtualServer

SOON = 1.0
"""Maximum of the median delay of STOP [s]. It takes a hundredth of this; single ones of a busy
machine, on which also this process waits, do not count."""

SILENT = 1100
"""Number of connections, more than the open files that the server may have."""


FEW_DESCRIPTORS = ("sh", "-c", 'ulimit -n 1024; exec "$0" "$@"', *APP)
"""Command of a server with a limit of open files, which it cannot raise itself."""


@contextmanager
def silent(port: int, count: int, data: bytes = b"") -> Iterator[list[socket.socket]]:
    """Open ``count`` connections that send ``data`` and nothing more."""
    sockets: list[socket.socket] = []
    try:
        for _ in range(count):
            connection = socket.socket()
            sockets.append(connection)
            connection.settimeout(2.0)
            with suppress(OSError):
                connection.connect(("127.0.0.1", port))
                connection.sendall(data)
        yield sockets
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
