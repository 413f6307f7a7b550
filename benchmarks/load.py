"""Effect of a crowd on the control loop and STOP: watchers, floods, slow readers, hostile messages.

    python -m benchmarks.load

A program swings the arm all the time. The turns are: no other clients; 32 watchers that acknowledge
pictures 30 times a second; senders that flood the server; readers that read nothing; senders of
messages that no page can send; silent connections; thirty programs of one person that together ask
for the branches twelve thousand times a second. Another server then has three cameras: nobody looks
at them, and two pages show each. Each turn prints how late the control loop's ticks
were (the server's own count) and how long a STOP takes: until the first tick known to brake, which
includes the path to the server, and until the sender knows it. Both processes read one clock. A
lost connection is printed, and the next turn follows.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
from websockets.exceptions import WebSocketException

from katana450.arm.runtime.pipes.state_publisher import TIMED_TICKS
from katana450.client import AsyncClient, aconnect
from katana450.errors import KatanaError
from katana450.extensions.cameras.camera_link import AGE
from katana450.server.api import answers, requests
from katana450.server.service.budget import IDENTITY_BUDGET, MAX_DEBT
from tests.browser.server import ATTENTIVE_APP, RECORDING_APP, AppServer, free_port
from tests.cameras.mjpeg_camera import stamp_of
from tests.gateway.client import SUBPROTOCOL, Peer, enter, page_name, websocket

WATCHERS = 32
PICTURES = 30.0
"""Pictures per second that each watcher acknowledges."""

FLOODS, SLOW, HOSTILE = 2, 4, 2

SILENT = 1100
"""Connections that send nothing; each that is closed is opened again."""

ASKING, ASKED = 30, 390.0
"""Programs that ask for the branches, and requests per second of each."""

RECOVERY = MAX_DEBT / IDENTITY_BUDGET + 1.0
"""[s] Pause between two turns."""

CAMERAS, PAGES = ("table", "side", "hand"), 2
"""Names of the cameras, 640x480 px 30 times a second, and number of pages that show each."""

TURN_SECONDS = 120.0
"""[s] Timeout of a turn."""

SWING = np.array((0.3, 0.15, 0.15, 0.2, 0.6))
"""[rad] Amplitude of each joint about the ready posture."""

PERIOD = 4.0
"""[s] Period of the swing."""


async def swing(arm: AsyncClient) -> None:
    """Move the arm until cancelled; continue after a STOP."""
    ready = np.array((await arm.query(answers.Arm)).ready)
    await arm.ask(requests.Take() if await _held(arm) else requests.Acquire())
    while True:
        with suppress(KeyError):
            now = time.monotonic()
            q = ready + SWING * math.sin(math.tau * now / PERIOD)
            await arm.send(requests.Servo(q=q))
            await asyncio.sleep(0.02)


async def _held(arm: AsyncClient) -> bool:
    return (await arm.query(answers.State)).holder is not None


async def watch(url: str, pictures: list[int]) -> None:
    """Receive the scene like a browser that draws ``PICTURES`` times a second, until cancelled."""
    cookie = enter(url)
    path = f"/viser?page={page_name()}"
    count = 0
    async with websocket(url, path, cookie, subprotocols=[SUBPROTOCOL]) as socket:

        async def draw() -> None:
            acknowledged = 0
            while True:
                await asyncio.sleep(1.0 / PICTURES)
                if count > acknowledged:
                    acknowledged = count
                    await socket.send(msgspec.msgpack.encode({"type": "Seen", "count": count}))

        drawing = asyncio.create_task(draw())
        try:
            async for _ in socket:
                count += 1
                pictures[0] += 1
        finally:
            drawing.cancel()


async def flood(url: str) -> None:
    """Send far too many requests; connect again after each disconnection."""
    while not _ended():
        # A disconnected client waits a moment before it connects again.
        await asyncio.sleep(0.1)
        with suppress(WebSocketException, OSError):
            async with websocket(url, "/api/v1/socket?name=Flood", max_queue=None) as socket:
                while True:
                    await socket.send('{"do": "query"}')
                    # Let the other clients in this process run.
                    await asyncio.sleep(0.0)


def _ended() -> bool:
    # A failing connection can turn a cancellation into a TimeoutError.
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


async def crawl(url: str) -> None:
    """Request all states and read nothing."""
    async with websocket(url, "/api/v1/socket?name=Slow", max_queue=1) as socket:
        await socket.send('{"do":"watch","hz":100}')
        await asyncio.sleep(math.inf)


async def poison(url: str) -> None:
    """Send messages to viser that no page can send."""
    while not _ended():
        with suppress(WebSocketException, OSError):
            path = f"/viser?page={page_name()}"
            async with websocket(url, path, enter(url), subprotocols=[SUBPROTOCOL]) as socket:
                peer = Peer(socket)
                await peer.learn()
                for label in peer.controls:
                    for value in (float("nan"), None, "x" * 500, [1.0] * 9):
                        await peer.set(label, value=value, disabled=True)


async def keep_silent(url: str) -> None:
    """Hold SILENT connections open, and open each again that the server closes."""
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
    """Ask for the branches ASKED times a second; connect again after each disconnection."""
    while not _ended():
        await asyncio.sleep(0.2)
        with suppress(WebSocketException, OSError):
            async with websocket(url, "/api/v1/socket?name=Inquire", max_queue=None) as socket:
                due = time.monotonic()
                while True:
                    await socket.send('{"do": "query","at":"branches"}')
                    due += 1.0 / ASKED
                    await asyncio.sleep(max(due - time.monotonic(), 0.0))


@dataclass
class Shown:
    """The pictures that pages got: their number, those left out, and their times.

    Attributes:
        count: number of pictures.
        dropped: number of pictures of the camera between two that came.
        delays: [s] from the sending of the camera to the page.
        errors: [s] differences between the times that page and camera name for a picture.
    """

    count: int = 0
    dropped: int = 0
    delays: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)


async def look(url: str, camera: str, shown: Shown) -> None:
    """Ask for each picture of ``camera``, as a page does, until cancelled."""
    before = None
    async with websocket(url, f"/api/v1/cameras/{camera}", enter(url)) as socket:
        while True:
            await socket.send("")
            message = await socket.recv()
            if isinstance(message, str):
                await asyncio.sleep(0.1)
                continue
            came, (age,) = time.perf_counter(), AGE.unpack_from(message)
            number, sent = stamp_of(message[AGE.size :])
            if before is not None:
                shown.count += 1
                shown.dropped += number - before - 1
                shown.delays.append(came - sent)
                shown.errors.append(came - age - sent)
            before = number


async def stop_times(arm: AsyncClient, times: int) -> list[tuple[float, float]]:
    """Return [s] from STOP until a tick brakes, and until a state shows it, each time.

    STOP is sent on all paths of the client, as in any program that calls ``stop``.
    """
    found: list[tuple[float, float]] = []
    states = arm.states(100.0)
    for _ in range(times):
        await arm.clear_stop()
        await asyncio.sleep(0.4)
        sent = time.perf_counter()
        pressed = asyncio.create_task(arm.stop())
        async for state in states:
            if state.status == "stopped":
                found.append((state.t - sent, time.perf_counter() - sent))
                break
        await pressed
    await arm.clear_stop()
    return found


async def turn(
    url: str, name: str, others: list[Callable[[], Awaitable[None]]], stops: int
) -> None:
    """Run one turn; print how late ticks were and how long a STOP took, or the error."""
    # Without access links all programs here share one budget, which a turn can use up.
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
    with suppress(WebSocketException):
        await work


async def crowd(url: str, stops: int) -> None:
    """Run all turns."""
    pictures = [0]
    watchers = [lambda: watch(url, pictures)] * WATCHERS
    await turn(url, "no other clients", [], stops)
    # A turn begins with a pause without watchers.
    started = time.monotonic() + RECOVERY
    await turn(url, f"{WATCHERS} watchers", [*watchers], stops)
    rate = pictures[0] / WATCHERS / (time.monotonic() - started)
    print(f"{'':20} {rate:.1f} pictures a second to each watcher")
    await turn(url, f"{FLOODS} flooding clients", [lambda: flood(url)] * FLOODS, stops)
    await turn(url, f"{SLOW} slow readers", [lambda: crawl(url)] * SLOW, stops)
    await turn(url, f"{HOSTILE} hostile clients", [lambda: poison(url)] * HOSTILE, stops)
    await turn(url, f"{SILENT} silent", [lambda: keep_silent(url)], stops)
    await turn(url, f"{ASKING} querying clients", [lambda: inquire(url)] * ASKING, stops)


async def cameras(url: str, stops: int) -> None:
    """Run the turns with cameras."""
    shown = Shown()
    await turn(url, "cameras, none shown", [], stops)
    looks = [partial(look, url, name, shown) for name in CAMERAS for _ in range(PAGES)]
    await turn(url, f"cameras, {PAGES} pages each", [*looks], stops)
    delay, error = (1e3 * np.percentile(values, 99) for values in (shown.delays, shown.errors))
    print(
        f"{'':20} {shown.count} pictures, {100 * shown.dropped / shown.count:.2f} % left out, "
        f"delay p99 {delay:.1f} ms, error of their time p99 {error:.1f} ms"
    )


def main() -> None:
    """Start a server, run all turns, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--stops", type=int, default=40, help="of each turn (default: 40)")
    parser.add_argument("--url", help=argparse.SUPPRESS)
    parser.add_argument("--with-cameras", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.url is not None:
        turns = cameras if options.with_cameras else crowd
        asyncio.run(turns(options.url, options.stops))
        return
    with AppServer(ATTENTIVE_APP) as server:
        _run_turns(server, options.stops)
    with ExitStack() as stack:
        sources = []
        for name in CAMERAS:
            port = free_port()
            command = [sys.executable, "-m", "tests.cameras.mjpeg_camera", str(port)]
            camera = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
            stack.callback(camera.kill)
            assert camera.stdout is not None
            sources.append(f"--camera={name}={camera.stdout.readline().decode().strip()}")
        # The pictures are recorded too, since the arm moves.
        server = stack.enter_context(AppServer((*RECORDING_APP, "--strict-silence", *sources)))
        _run_turns(server, options.stops, "--with-cameras")


def _run_turns(server: AppServer, stops: int, *options: str) -> None:
    # The clients run in a separate process, so that they do not slow the server's threads.
    command = [sys.executable, "-m", "benchmarks.load", "--url", server.url, *options]
    root = Path(__file__).resolve().parents[1]
    # One turn more than there are, for time outside the turns.
    subprocess.run(
        [*command, "--stops", str(stops)], cwd=root, check=True, timeout=8.0 * TURN_SECONDS
    )


if __name__ == "__main__":
    main()
