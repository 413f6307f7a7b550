"""Time from the last message of a driver until its arm brakes, alone and under attack.

    python -m benchmarks.silence

The server has the profile of a real arm. The driver starts a long motion and streams heartbeats.
Then it sends nothing more on its open connection, on which it still receives states. The time ends
with the first state in which the stop is confirmed, by its own time stamp: server and benchmark
read the same clock of the machine. The attacks are those of ``benchmarks.stop``, without the flood
of STOP, under which an arm never moves.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection

from benchmarks.stop import ATTACKS, DESCRIPTIONS, LOST, Links, attacked
from katana450.server.web.access_links import AccessFile
from katana450.settings import Settings
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import websocket

NAMES = tuple(name for name in ATTACKS if name != "STOP flooders")

SIDES = (-1.2, 1.2)
"""[rad] Angles of axis 1 between which the arm moves in turn, which takes longer than a trial."""

STREAMED = 0.6
"""[s] Duration of the heartbeats before the driver falls silent."""

INTERVAL = 0.02
"""[s] Interval of the heartbeats."""

CLEARING = 0.2
"""[s] Interval of the requests to clear the stop."""

TOLERANCE = 0.05
"""[s] Difference from the timeout that counts as in time."""


class Driver:
    """The connection of a driver that can fall silent."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket

    async def say(self, do: str, **fields: Any) -> float:
        """Send the request ``do``; return the time [s]."""
        await self._socket.send(json.dumps({"do": do, **fields}))
        return time.perf_counter()

    async def state(self) -> dict[str, Any]:
        """Return the next state."""
        while True:
            message: dict[str, Any] = json.loads(await self._socket.recv())
            if message["is"] == "state":
                return message

    async def clear(self) -> None:
        """Clear the stop, if there is one."""
        due = 0.0
        while (await self.state())["stop"] is not None:
            if time.perf_counter() >= due:
                due = await self.say("clear_stop") + CLEARING

    async def fall_silent(self, side: float) -> float:
        """Move to ``side`` [rad], fall silent; return the time until the stop is confirmed [s]."""
        await self.say("joints", q=[side, *Settings.ready[1:]])
        last, end = 0.0, time.perf_counter() + STREAMED
        while time.perf_counter() < end:
            last = await self.say("heartbeat")
            await asyncio.sleep(INTERVAL)
        while True:
            state = await self.state()
            if state["stop"] == "confirmed":
                return float(state["t"]) - last


async def measure(url: str, links: Links, trials: int) -> list[float]:
    """Return the times of ``trials`` silences [s]; inf where the arm was not stopped."""
    found: list[float] = []
    headers = {"Authorization": f"Bearer {links.driver}"}
    path = "/api/v1/socket?name=Driver"
    async with websocket(url, path, headers=headers, max_queue=None) as socket:
        driver = Driver(socket)
        await driver.say("take")
        await driver.say("watch", hz=100.0)
        for number in range(trials):
            try:
                async with asyncio.timeout(LOST + STREAMED):
                    await driver.clear()
                    found.append(await driver.fall_silent(SIDES[number % 2]))
            except TimeoutError:
                found.append(math.inf)
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
