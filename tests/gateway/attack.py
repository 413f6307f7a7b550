"""Attacks from this machine, bounded in number and time, and the delay of STOP meanwhile."""

from __future__ import annotations

import asyncio
import socket
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress

from websockets.exceptions import ConnectionClosed

from tests.browser.server import APP
from tests.gateway.client import Control, websocket

FEW_DESCRIPTORS = ("sh", "-c", 'ulimit -n 1024; exec "$0" "$@"', *APP)
"""Command of a server with a limit of open files, which it cannot raise itself."""


@contextmanager
def silent(port: int, count: int, data: bytes = b"") -> Iterator[list[socket.socket]]:
    """Open ``count`` connections that send ``data`` and nothing more."""
    sockets: list[socket.socket] = []
    try:
        for _ in range(count):
            each = socket.socket()
            sockets.append(each)
            each.settimeout(2.0)
            with suppress(OSError):
                each.connect(("127.0.0.1", port))
                each.sendall(data)
        yield sockets
    finally:
        for each in sockets:
            each.close()


def closed(sockets: list[socket.socket], seconds: float) -> int:
    """Return the number of ``sockets`` that the other side closes within ``seconds``."""
    left, until = set(sockets), time.monotonic() + seconds
    while left and time.monotonic() < until:
        for each in tuple(left):
            each.settimeout(0.01)
            try:
                if each.recv(65_536) == b"":
                    left.discard(each)
            except TimeoutError:
                continue
            except OSError:
                left.discard(each)
    return len(sockets) - len(left)


@asynccontextmanager
async def asking(
    url: str, sockets: int, hz: float, what: str = "branches", token: str = ""
) -> AsyncIterator[Counter[str]]:
    """Send ``hz`` requests per second on each of ``sockets`` websockets; count the answers."""
    heard: Counter[str] = Counter()
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    request = f'{{"do": "query","at":"{what}"}}'

    async def ask() -> None:
        path = "/api/v1/socket?name=Asks"
        async with websocket(url, path, headers=headers, max_queue=None) as line:
            heard["connected"] += 1

            async def listen() -> None:
                async for text in line:
                    heard["refused" if '"refused"' in str(text) else "answered"] += 1

            listening = asyncio.create_task(listen())
            due = time.monotonic()
            try:
                while True:
                    await line.send(request)
                    due += 1.0 / hz
                    await asyncio.sleep(max(due - time.monotonic(), 0.0))
            finally:
                listening.cancel()

    async def again_and_again() -> None:
        while True:
            with suppress(ConnectionClosed, OSError):
                await ask()
            heard["ended"] += 1
            await asyncio.sleep(0.2)

    tasks = [asyncio.create_task(again_and_again()) for _ in range(sockets)]
    try:
        yield heard
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks, timeout=5.0)


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
