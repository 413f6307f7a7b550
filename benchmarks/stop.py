"""Time of STOP by every path, alone and under attack.

    python -m benchmarks.stop

The arm swings. Presses go by turns on four paths: the driver's own websocket on the main port,
until a state that is stopped is received; the main port and the port of STOP, each as a new
connection of a viewer, until the answer ``confirmed``; and all paths of the Python client at once,
until the first confirms. The server requires access links. Driver and presser are in this process,
the attackers in another one, the server in its own; all share the machine. A press that is not
confirmed within 5 s counts as lost.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import secrets
import socket
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from websockets.exceptions import ConnectionClosed

from benchmarks.load import ASKED, ASKING, SILENT, keep_silent, swing
from katana450.arm.control.lease import Role
from katana450.client import AsyncClient, aconnect
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from tests.browser.server import ATTENTIVE_APP, ROOT, AppServer
from tests.gateway.client import HOUR, websocket

WATCHERS, WATCHED = 45, 100.0
"""Programs that receive states, and states per second of each."""

FLOODERS = 3
"""Clients that send STOP all the time, on both ports."""

UPLOADS = 40
"""Uploads that send one byte a second."""

ADDRESSES = 10_000
"""Addresses of this machine from which silent connections come."""

CONNECTIONS, HELD = 1_000, 2_000
"""Silent connections per second from these addresses, and how many are held open."""

LINKS = 3
"""Access links that the attackers share: one link may have 32 websockets."""

LOST = 5.0
"""[s] Timeout of a press."""

SWING_SECONDS = 0.4
"""[s] Minimum time of the swing before a press."""


class Links(NamedTuple):
    """Tokens of the access links: the driver, the presser, and the attackers."""

    driver: str
    presser: str
    attackers: list[str]

    @classmethod
    def give(cls, file: AccessFile) -> Links:
        """Return new links in ``file``."""
        expires = time.time() + HOUR
        attackers = [file.give(f"Attacker {n}", Role.OPERATOR, expires) for n in range(LINKS)]
        driver = file.give("Driver", Role.ADMIN, expires)
        return cls(driver, file.give("Presser", Role.VIEWER, expires), attackers)


def head(path: str, token: str, length: int = 0) -> bytes:
    """Return the head of a POST request for ``path``."""
    lines = (
        f"POST {path} HTTP/1.1",
        "Host: localhost",
        f"Authorization: Bearer {token}",
        f"Content-Length: {length}",
        "Connection: close",
    )
    return "\r\n".join((*lines, "", "")).encode()


def address(url: str) -> tuple[str, int]:
    """Return host and port of ``url``."""
    return "127.0.0.1", int(url.rpartition(":")[2])


@asynccontextmanager
async def posted(url: str, data: bytes) -> AsyncIterator[asyncio.StreamReader]:
    """Send ``data`` on a new connection, and close it afterwards."""
    reader, writer = await asyncio.open_connection(*address(url))
    try:
        writer.write(data)
        yield reader
    finally:
        writer.transport.abort()


# Attacks

Attack = Callable[[str, str, Links], list[Awaitable[None]]]


async def again(work: Callable[[], Awaitable[None]]) -> None:
    """Repeat ``work`` whenever its connection ends."""
    while True:
        with suppress(ConnectionClosed, OSError):
            await work()
        await asyncio.sleep(0.2)


async def send_often(url: str, token: str, message: str, hz: float) -> None:
    """Send ``message`` on a websocket ``hz`` times per second, and read everything."""
    headers = {"Authorization": f"Bearer {token}"}
    path = "/api/v1/socket?name=Attacker"
    async with websocket(url, path, headers=headers, max_queue=None) as socket:
        due = time.monotonic()
        while True:
            await socket.send(message)
            due += 1.0 / hz
            await asyncio.sleep(max(due - time.monotonic(), 0.0))


async def watch(url: str, token: str) -> None:
    """Receive states at the maximum rate."""
    headers = {"Authorization": f"Bearer {token}"}
    async with websocket(url, "/api/v1/socket?name=Watcher", headers=headers) as socket:
        await socket.send(json.dumps({"do": "watch", "hz": WATCHED}))
        async for _ in socket:
            pass


async def press_often(url: str, token: str) -> None:
    """Send STOP without a pause, each time on a new connection."""
    while True:
        async with posted(url, head("/api/v1/stop", token)) as reader:
            await reader.read(200)


async def drip(url: str, token: str) -> None:
    """Upload a file, one byte a second."""
    path = "/api/v1/mesh?name=a.stl&unit=m"
    reader, writer = await asyncio.open_connection(*address(url))
    try:
        writer.write(head(path, token, 100_000))
        while not reader.at_eof():
            writer.write(b"x")
            await writer.drain()
            await asyncio.sleep(1.0)
    finally:
        writer.transport.abort()


async def connect_often(url: str) -> None:
    """Open silent connections from many addresses, ``CONNECTIONS`` per second."""
    server, held = address(url), deque[socket.socket]()
    began, count = time.monotonic(), 0
    while True:
        while count < CONNECTIONS * (time.monotonic() - began):
            high, low = divmod(count % ADDRESSES, 100)
            silent = socket.socket()
            silent.setblocking(False)
            silent.bind((f"127.1.{1 + high}.{1 + low}", 0))
            with suppress(BlockingIOError):
                silent.connect(server)
            held.append(silent)
            count += 1
            if len(held) > HELD:
                held.popleft().close()
        await asyncio.sleep(0.005)


def many(number: int, of: Callable[[int], Awaitable[None]]) -> list[Awaitable[None]]:
    """Return ``number`` repeated works."""
    return [again(lambda n=n: of(n)) for n in range(number)]  # type: ignore[misc]


def _token(links: Links, number: int) -> str:
    return links.attackers[number % LINKS]


BRANCHES = json.dumps({"do": "query", "at": "branches"})

ATTACKS: dict[str, Attack] = {
    "alone": lambda *_: [],
    "silent": lambda url, *_: [keep_silent(url)],
    "silent at STOP": lambda _, stop_url, __: [keep_silent(stop_url)],
    "addresses": lambda url, *_: [connect_often(url)],
    "addresses at STOP": lambda _, stop_url, __: [connect_often(stop_url)],
    "branches": lambda url, _, links: many(
        ASKING, lambda n: send_often(url, _token(links, n), BRANCHES, ASKED)
    ),
    "watchers": lambda url, _, links: many(WATCHERS, lambda n: watch(url, _token(links, n))),
    "STOP flooders": lambda url, stop_url, links: [
        *many(FLOODERS, lambda n: press_often(url, _token(links, n))),
        *many(FLOODERS, lambda n: press_often(stop_url, _token(links, n))),
    ],
    "broken access file": lambda *_: [],
    "uploads": lambda url, _, links: many(UPLOADS, lambda n: drip(url, _token(links, n))),
}
"""Attacks by their names: works for the address of the server, that of STOP, and the links."""

MANY_ADDRESSES = f"{CONNECTIONS:,} silent connections a second from {ADDRESSES:,} addresses"

DESCRIPTIONS = {
    "alone": "none",
    "silent": f"{SILENT:,} silent connections, main port",
    "silent at STOP": f"{SILENT:,} silent connections, port of STOP",
    "addresses": f"{MANY_ADDRESSES}, main port",
    "addresses at STOP": f"{MANY_ADDRESSES}, port of STOP",
    "branches": f"{ASKING} programs that query the branches {ASKED:.0f} times a second each",
    "watchers": f"{WATCHERS} programs that receive {WATCHED:.0f} states a second each",
    "STOP flooders": f"{FLOODERS} clients that send STOP all the time, on both ports",
    "broken access file": "access file unreadable",
    "uploads": f"{UPLOADS} uploads that send a byte a second",
}


async def attack(name: str, url: str, stop_url: str, links: Links) -> None:
    """Run the attack ``name`` until the process is ended."""
    await asyncio.gather(*ATTACKS[name](url, stop_url, links))


# Measurement


async def press_main(
    sending: Awaitable[object], states: AsyncGenerator[answers.State, None]
) -> float:
    """Return the time from ``sending`` a STOP until a state that is stopped arrives [s]."""
    await anext(states)
    began = time.perf_counter()
    pressing = asyncio.ensure_future(sending)
    async for state in states:
        if state.stop == "confirmed":
            break
    took = time.perf_counter() - began
    await pressing
    return took


async def press_client(arm: AsyncClient) -> float:
    """Return the time from STOP by ``arm`` until a path confirms it [s]; inf if none does."""
    began = time.perf_counter()
    stage = await arm.stop()
    return time.perf_counter() - began if stage == "confirmed" else math.inf


async def post_stop(url: str, token: str) -> bytes:
    """Send STOP to a port on a new connection, and return the answer."""
    async with posted(url, head("/api/v1/stop", token)) as reader:
        return await reader.read()


async def press_stop(stop_url: str, token: str) -> float:
    """Return the time from STOP to its port until the answer ``confirmed`` [s]; inf without it."""
    began = time.perf_counter()
    answer = await post_stop(stop_url, token)
    return time.perf_counter() - began if b'"confirmed"' in answer else math.inf


async def measure(
    name: str, url: str, stop_url: str, links: Links, presses: int
) -> dict[str, list[float]]:
    """Return the times of ``presses`` presses by each path [s]; inf for a lost one."""
    async with aconnect(url, "Driver", links.driver) as arm:
        states = arm.states(100.0)
        paths: dict[str, Callable[[], Awaitable[float]]] = {
            "main, websocket": lambda: press_main(
                arm.send(requests.Stop(press=secrets.token_hex(8))), states
            ),
            "main, new connection": lambda: press_main(post_stop(url, links.presser), states),
            "port of STOP": lambda: press_stop(stop_url, links.presser),
            "client": lambda: press_client(arm),
        }
        found: dict[str, list[float]] = {path: [] for path in paths}
        swinging = asyncio.create_task(swing(arm))
        await asyncio.sleep(1.0)
        for _ in range(presses):
            for path, times in found.items():
                # Floods of STOP keep the arm stopped.
                if name != "STOP flooders":
                    with suppress(KatanaError):
                        await arm.clear_stop()
                await asyncio.sleep(SWING_SECONDS)
                try:
                    async with asyncio.timeout(LOST):
                        times.append(await paths[path]())
                except (TimeoutError, OSError, EOFError, KatanaError):
                    times.append(math.inf)
                    # A generator ends with its timeout.
                    states = arm.states(100.0)
        swinging.cancel()
        with suppress(asyncio.CancelledError):
            await swinging
    return found


@contextmanager
def attacked(name: str, url: str, stop_url: str, links: Links, path: Path) -> Iterator[None]:
    """Run the attack ``name`` in another process inside the ``with`` block."""
    if name == "broken access file":
        content = path.read_bytes()
        path.write_bytes(b"{")
        yield
        path.write_bytes(content)
        return
    words = ("--attack", name, url, stop_url, json.dumps(links))
    with subprocess.Popen([sys.executable, "-m", "benchmarks.stop", *words], cwd=ROOT) as process:
        time.sleep(3.0)
        try:
            yield
        finally:
            process.kill()


def shown(times: list[float]) -> str:
    """Return p50, p99 and maximum of ``times``, and how many were confirmed."""
    kept = [each for each in times if math.isfinite(each)]
    p50, p99 = 1e3 * np.percentile(kept, (50, 99)) if kept else (math.inf, math.inf)
    most = 1e3 * max(kept, default=math.inf)
    return f"{p50:6.1f} | {p99:6.1f} | {most:6.1f} | {len(kept)} of {len(times)}"


def main() -> None:
    """Start a server for each attack, measure, print rows of a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--presses", type=int, default=200, help="by each path (default: 200)")
    parser.add_argument("--only", nargs="*", choices=ATTACKS, help="attacks (default: all)")
    parser.add_argument("--attack", nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.attack is not None:
        name, url, stop_url, text = options.attack
        asyncio.run(attack(name, url, stop_url, Links(*json.loads(text))))
        return
    print("| attack | path | p50, ms | p99, ms | max, ms | confirmed |", flush=True)
    for name in options.only or ATTACKS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "access.json"
            links = Links.give(AccessFile.create(path))
            with AppServer((*ATTENTIVE_APP, "--access", str(path))) as server:
                url, stop_url = server.url, server.stop_url
                with attacked(name, url, stop_url, links, path):
                    work = measure(name, url, stop_url, links, options.presses)
                    found = asyncio.run(work)
        for which, times in found.items():
            print(f"| {DESCRIPTIONS[name]} | {which} | {shown(times)} |", flush=True)


if __name__ == "__main__":
    main()
