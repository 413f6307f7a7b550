"""Time from the last message of a driver until its arm brakes, alone and under attack.

    python -m benchmarks.silence

The server has the profile of a real arm. The driver streams setpoints, then sends nothing more on
its open connection. The time ends with the first state that is stopped, by its own time stamp:
server and benchmark read the same clock of the machine. The attacks are those of
``benchmarks.stop``, without the flood of STOP, under which an arm never moves.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import tempfile
import time
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection

from benchmarks.load import PERIOD, SWING
from benchmarks.stop import ATTACKS, DESCRIPTIONS, LOST, Links, attacked
from katana450.client import aconnect
from katana450.server.api import answers
from katana450.server.web.access_links import AccessFile
from katana450.settings import Settings
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import websocket

NAMES = tuple(name for name in ATTACKS if name != "STOP flooders")

STREAMED = 0.6
"""[s] Duration of the stream before the driver falls silent."""

INTERVAL = 0.02
"""[s] Interval of the stream."""

CLEARING = 0.2
"""[s] Interval of the requests to clear the stop."""

TOLERANCE = 0.05
"""[s] Difference from the timeout that counts as in time."""


async def say(socket: ClientConnection, do: str, **fields: Any) -> None:
    """Send the request ``do``."""
    await socket.send(json.dumps({"do": do, **fields}))


async def clear(socket: ClientConnection, states: AsyncGenerator[answers.State, None]) -> None:
    """Clear the stop, if there is one, as the driver."""
    due = 0.0
    async for state in states:
        if state.stopped is None:
            return
        if time.perf_counter() >= due:
            due = time.perf_counter() + CLEARING
            await say(socket, "take")
            await say(socket, "clear_stop")


async def fall_silent(
    socket: ClientConnection, states: AsyncGenerator[answers.State, None]
) -> float:
    """Stream, fall silent; return the time from the last message to the first stopped state [s]."""
    last, end = 0.0, time.perf_counter() + STREAMED
    while time.perf_counter() < end:
        q = np.array(Settings.ready) + SWING * math.sin(math.tau * time.perf_counter() / PERIOD)
        await say(socket, "servo", q=q.tolist())
        last = time.perf_counter()
        await asyncio.sleep(INTERVAL)
    async for state in states:
        if state.stopped is not None:
            return state.t - last
    return math.inf


async def measure(url: str, links: Links, trials: int) -> list[float]:
    """Return the times of ``trials`` silences [s]; inf where the arm was not stopped."""
    found: list[float] = []
    headers = {"Authorization": f"Bearer {links.driver}"}
    path = "/api/v1/socket?name=Driver"
    async with (
        aconnect(url, "Observer", links.presser) as observer,
        websocket(url, path, headers=headers, max_queue=None) as socket,
    ):
        states = observer.states(100.0)
        await say(socket, "take")
        for _ in range(trials):
            try:
                async with asyncio.timeout(LOST + STREAMED):
                    await clear(socket, states)
                    found.append(await fall_silent(socket, states))
            except TimeoutError:
                found.append(math.inf)
                states = observer.states(100.0)
    return found


def shown(times: list[float]) -> str:
    """Return minimum, median and maximum of ``times``, and how many were in time."""
    low, middle, high = (float(f(times)) for f in (min, np.median, max))
    in_time = sum(abs(each - Settings.silence) <= TOLERANCE for each in times)
    return f"{low:.3f} | {middle:.3f} | {high:.3f} | {in_time} of {len(times)}"


def main() -> None:
    """Start a server for each attack, measure, print a row of a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--trials", type=int, default=40, help="by attack (default: 40)")
    parser.add_argument("--only", nargs="*", choices=NAMES, help="attacks (default: all)")
    options = parser.parse_args()
    print("| attack | min, s | p50, s | max, s | within 0.25 s ± 0.05 |", flush=True)
    for name in options.only or NAMES:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "access.json"
            links = Links.give(AccessFile.create(path))
            with (
                AppServer((*ATTENTIVE_APP, "--access", str(path))) as server,
                attacked(name, server.url, server.stop_url, links, path),
            ):
                times = asyncio.run(measure(server.url, links, options.trials))
        print(f"| {DESCRIPTIONS[name]} | {shown(times)} |", flush=True)


if __name__ == "__main__":
    main()
