"""What the control loop and STOP feel of a crowd: watchers, floods, slow readers, hostile messages.

    python -m benchmarks.load

A program swings the arm all the time. In turn there are: nobody else; 32 watchers who say 30 times
a second what they have seen; senders who flood the server; readers who read nothing; senders of
messages no page can have sent; connections that say nothing; thirty programs of one person that
together ask for the branches twelve thousand times a second. Of each turn are printed how late the
control loop's ticks came (the server's own count) and how long a STOP takes: until the first tick
known to brake, which includes the way to the server, and until the program that said it knows. Both
processes read one clock. A connection that is lost is printed as such, and the next turn follows.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from pathlib import Path

import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed

from katana450.arm.runtime.loop_timing import TIMED_TICKS
from katana450.client import AsyncClient, aconnect
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from katana450.server.service.budget import IDENTITY_BUDGET, MAX_DEBT
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import SUBPROTOCOL, Peer, enter, page_name, websocket

WATCHERS = 32
PICTURES = 30.0
"""A second, of which each watcher says that it has seen them."""

FLOODS, SLOW, HOSTILE = 2, 4, 2

SILENT = 1100
"""Connections that say nothing; each that is closed comes again."""

ASKING, ASKED = 30, 390.0
"""Programs that ask for the branches, and how many times a second each."""

RECOVERY = MAX_DEBT / IDENTITY_BUDGET + 1.0
"""[s] Between two turns."""

TURN_SECONDS = 120.0
"""[s] A turn that takes longer is given up."""

SWING = np.array((0.3, 0.15, 0.15, 0.2, 0.6))
"""[rad] Of each joint about the ready posture."""

PERIOD = 4.0
"""[s] Of the swing."""


async def swing(arm: AsyncClient) -> None:
    """Move the arm for ever; after a STOP, go on."""
    ready = np.array((await arm.query(answers.Arm)).ready)
    await arm.ask(requests.Take() if await _held(arm) else requests.Acquire())
    while True:
        with suppress(KeyError):
            now = time.monotonic()
            q = ready + SWING * math.sin(math.tau * now / PERIOD)
            await arm.tell(requests.Servo(q=q.tolist()))
            await asyncio.sleep(0.02)


async def _held(arm: AsyncClient) -> bool:
    return (await arm.query(answers.State)).holder is not None


async def watch(url: str, pictures: list[int]) -> None:
    """See the scene as a browser does that draws ``PICTURES`` times a second, until cancelled."""
    cookie = enter(url)
    path = f"/viser?page={page_name()}"
    count = 0
    async with websocket(url, path, cookie, subprotocols=[SUBPROTOCOL]) as socket:

        async def draw() -> None:
            told = 0
            while True:
                await asyncio.sleep(1.0 / PICTURES)
                if count > told:
                    told = count
                    await socket.send(msgspec.msgpack.encode({"type": "Seen", "count": told}))

        drawing = asyncio.create_task(draw())
        try:
            async for _ in socket:
                count += 1
                pictures[0] += 1
        finally:
            drawing.cancel()


async def flood(url: str) -> None:
    """Say far too much, be sent away, come again."""
    while not _ended():
        # Whoever is sent away takes a moment to come again.
        await asyncio.sleep(0.1)
        with suppress(ConnectionClosed, OSError):
            async with websocket(url, "/api/v1/socket?name=Flood", max_queue=None) as socket:
                while True:
                    await socket.send('{"do": "query"}')
                    # So that this process has time for the others it plays.
                    await asyncio.sleep(0.0)


def _ended() -> bool:
    # A connection that was about to fail can turn a cancellation into a TimeoutError.
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


async def crawl(url: str) -> None:
    """Ask for all there is and read nothing."""
    async with websocket(url, "/api/v1/socket?name=Slow", max_queue=1) as socket:
        await socket.send('{"do":"watch","hz":100}')
        await asyncio.sleep(math.inf)


async def poison(url: str) -> None:
    """Send viser what no page can have sent."""
    while not _ended():
        with suppress(ConnectionClosed, OSError):
            path = f"/viser?page={page_name()}"
            async with websocket(url, path, enter(url), subprotocols=[SUBPROTOCOL]) as socket:
                peer = Peer(socket)
                await peer.learn()
                for label in peer.controls:
                    for value in (float("nan"), None, "x" * 500, [1.0] * 9):
                        await peer.set(label, value=value, disabled=True)


async def keep_silent(url: str) -> None:
    """Hold SILENT connections open, and open those anew that the server closes."""
    address = (url.rpartition("/")[2].partition(":")[0], int(url.rpartition(":")[2]))
    writers: list[asyncio.StreamWriter] = []
    try:
        while not _ended():
            for _ in range(20):
                with suppress(OSError):
                    writers.append((await asyncio.open_connection(*address))[1])
            writers = [each for each in writers if not each.transport.is_closing()]
            await asyncio.sleep(0.01 if len(writers) < SILENT else 0.5)
    finally:
        for each in writers:
            each.transport.abort()


async def inquire(url: str) -> None:
    """Ask for the branches ASKED times a second; when sent away, come again."""
    while not _ended():
        await asyncio.sleep(0.2)
        with suppress(ConnectionClosed, OSError):
            async with websocket(url, "/api/v1/socket?name=Inquire", max_queue=None) as socket:
                due = time.monotonic()
                while True:
                    await socket.send('{"do": "query","at":"branches"}')
                    due += 1.0 / ASKED
                    await asyncio.sleep(max(due - time.monotonic(), 0.0))


async def stop_times(arm: AsyncClient, times: int) -> list[tuple[float, float]]:
    """[s] from saying STOP until a tick brakes, and until a state tells so, each time."""
    found: list[tuple[float, float]] = []
    states = arm.states(100.0)
    for _ in range(times):
        await arm.ask(requests.ClearStop())
        await asyncio.sleep(0.4)
        said = time.perf_counter()
        await arm.tell(requests.Stop())
        async for state in states:
            if state.status == "stopped":
                found.append((state.t - said, time.perf_counter() - said))
                break
    await arm.ask(requests.ClearStop())
    return found


async def turn(
    url: str, name: str, others: list[Callable[[], Awaitable[None]]], stops: int
) -> None:
    """One turn: print how late the ticks came, and how long a STOP took; or what was lost."""
    # Without links all programs here share a budget, which a turn may have used up.
    await asyncio.sleep(RECOVERY)
    try:
        async with asyncio.timeout(TURN_SECONDS):
            await _turn(url, name, others, stops)
    except* (KatanaError, TimeoutError, OSError) as lost:
        print(f"{name:20} given up: {lost.exceptions[0]!r}", flush=True)


async def _turn(
    url: str, name: str, others: list[Callable[[], Awaitable[None]]], stops: int
) -> None:
    async with AsyncExitStack() as stack:
        group = await stack.enter_async_context(asyncio.TaskGroup())
        tasks = [group.create_task(_alone(other())) for other in others]
        arm = await stack.enter_async_context(aconnect(url, "Swing"))
        swinging = group.create_task(_alone(swing(arm)))
        await asyncio.sleep(2.0)
        took = await stop_times(arm, stops)
        period = (await arm.query(answers.Loop)).period
        await asyncio.sleep(TIMED_TICKS * period)
        loop = await arm.query(answers.Loop)
        for task in (*tasks, swinging):
            task.cancel()
    p50, p99 = 1e3 * np.percentile(took, (50, 99), axis=0)
    print(
        f"{name:20} ticks late p50 {1e3 * loop.late_p50:5.2f} p99 {1e3 * loop.late_p99:5.2f} most "
        f"{1e3 * loop.late_max:6.2f} ms   STOP brakes p50 {p50[0]:5.1f} p99 {p99[0]:5.1f}, "
        f"known p50 {p50[1]:5.1f} p99 {p99[1]:5.1f} ms",
        flush=True,
    )


async def _alone(work: Awaitable[None]) -> None:
    with suppress(ConnectionClosed):
        await work


async def crowd(url: str, stops: int) -> None:
    """All turns."""
    pictures = [0]
    watchers = [lambda: watch(url, pictures)] * WATCHERS
    await turn(url, "nobody else", [], stops)
    # A turn begins with a pause in which nobody watches.
    begun = time.monotonic() + RECOVERY
    await turn(url, f"{WATCHERS} watchers", [*watchers], stops)
    rate = pictures[0] / WATCHERS / (time.monotonic() - begun)
    print(f"{'':20} {rate:.1f} pictures a second to each watcher")
    await turn(url, f"{FLOODS} who flood", [lambda: flood(url)] * FLOODS, stops)
    await turn(url, f"{SLOW} who read nothing", [lambda: crawl(url)] * SLOW, stops)
    await turn(url, f"{HOSTILE} hostile", [lambda: poison(url)] * HOSTILE, stops)
    await turn(url, f"{SILENT} silent", [lambda: keep_silent(url)], stops)
    await turn(url, f"{ASKING} who inquire", [lambda: inquire(url)] * ASKING, stops)


def main() -> None:
    """Start a server, load it, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--stops", type=int, default=40, help="of each turn (default: 40)")
    parser.add_argument("--url", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.url is not None:
        asyncio.run(crowd(options.url, options.stops))
        return
    with AppServer(ATTENTIVE_APP) as server:
        root = Path(__file__).resolve().parents[1]
        # Clients in a process of their own, so that they do not slow the server's threads.
        command = [sys.executable, "-m", "benchmarks.load", "--url", server.url]
        stops = ("--stops", str(options.stops))
        # One turn more than there are, for what the turns themselves do not bound.
        subprocess.run([*command, *stops], cwd=root, check=True, timeout=8.0 * TURN_SECONDS)


if __name__ == "__main__":
    main()
