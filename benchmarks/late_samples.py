"""Travel of the tool after a hand on a slow connection lets go, and executed late samples.

A client streams jogs, samples of joint angles or steps by a connection that delays all data. It is
slow from the beginning, or becomes slow during the motion without any silence. Then the hand lets
go, and the tool is watched by another connection until it rests. The last row has a connection
whose delay jumps, until enough samples were late: more than the limit beyond the least delay.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import math
import random
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from katana450.arm.control.lease import HEARTBEAT_INTERVAL
from katana450.client.asynchronous import AsyncClient, aconnect
from katana450.server.api import answers, requests
from katana450.server.service.command_gate import SETTLE_TIME
from katana450.settings import Settings
from tests.browser.server import SIMULATION_APP, AppServer
from tests.gateway.client import websocket
from tests.gateway.delayed_link import DelayedLink

PERIOD = 0.02
"""[s] Time between two samples."""

STREAMED, BEFORE = 3.5, 0.75
"""[s] Duration of a stream, and the time in it after which a connection becomes slow."""

GROWTH = 0.8
"""[s/s] Growth of a delay, which leaves no silence between the samples."""

SPEED, RATE = 0.05, 0.25
"""[m/s] of jogs and steps, and [rad/s] of axis 1 in a stream of joint angles."""

MARGIN = 0.01
"""[s] Delay beyond the limit from which a sample counts as late, for the time of its handling."""

DELAYS = (0.0, 0.5, 2.0)
"""[s] Delays of the rows."""

Sample = Callable[[int, float], dict[str, Any]]


def jog(_number: int, side: float) -> dict[str, Any]:
    """Return a jog to one ``side``."""
    return {"do": "jog", "rates": (0.0, side * SPEED, 0.0, 0.0, 0.0)}


def step(_number: int, side: float) -> dict[str, Any]:
    """Return a step of the target."""
    return {"do": "step_tool", "by": (0.0, side * SPEED * PERIOD, 0.0, 0.0, 0.0)}


def servo(number: int, side: float) -> dict[str, Any]:
    """Return a sample of joint angles."""
    turned = side * RATE * (number * PERIOD - STREAMED / 2.0)
    return {"do": "servo", "q": [turned, *Settings.ready[1:]], "qd": [side * RATE, 0, 0, 0, 0]}


@dataclass
class Stream:
    """Samples of one client, by the number that is their id.

    Attributes:
        lateness: delay [s] of each beyond the least one.
        executed: whether each was executed.
    """

    socket: Any
    link: DelayedLink
    lateness: list[float] = field(default_factory=list)
    executed: set[int] = field(default_factory=set)
    _arrives: float = 0.0
    _least: float = math.inf

    async def say(self, request: dict[str, Any]) -> None:
        """Send a sample, which the link delays by its present delay."""
        t, number = time.monotonic(), len(self.lateness)
        await self.send({**request, "id": number})
        self._arrives = max(self._arrives, t + self.link.delay)
        self._least = min(self._least, self._arrives - t)
        self.lateness.append(self._arrives - t - self._least)

    async def let_go(self) -> None:
        """Send the end of a jog, which is executed whenever it arrives."""
        await self.send(jog(0, 0.0))

    async def send(self, request: dict[str, Any]) -> None:
        """Send ``request`` with the time of its making."""
        await self.socket.send(json.dumps({**request, "made": time.monotonic()}))

    async def beat(self) -> None:
        """Send heartbeats."""
        while True:
            await self.send({"do": "heartbeat"})
            await asyncio.sleep(HEARTBEAT_INTERVAL)

    async def listen(self) -> None:
        """Take the answers."""
        while True:
            answer = json.loads(await self.socket.recv())
            if answer["is"] == "done" and isinstance(answer["id"], int):
                self.executed.add(answer["id"])

    @property
    def late(self) -> set[int]:
        """The numbers of the late samples."""
        limit = Settings.sample_delay + MARGIN
        return {number for number, late in enumerate(self.lateness) if late > limit}


@asynccontextmanager
async def stream(link: DelayedLink) -> AsyncIterator[Stream]:
    """Connect a client by ``link``."""
    url = f"http://127.0.0.1:{link.port}"
    async with websocket(url, "/api/v1/socket?name=Hand", origin=None, max_queue=None) as socket:
        hand = Stream(socket, link)
        tasks = [asyncio.create_task(each) for each in (hand.beat(), hand.listen())]
        try:
            yield hand
            # What is under way arrives, and its answer returns.
            await asyncio.sleep(2.0 * link.delay + 0.3)
        finally:
            for task in tasks:
                task.cancel()


async def point(watcher: AsyncClient) -> Any:
    """Return the tool point (3,) [m]."""
    return np.array((await watcher.query(answers.State)).T)[:3, 3]


async def rest(watcher: AsyncClient) -> Any:
    """Return the tool point (3,) [m] once it rests."""
    while True:
        before = await point(watcher)
        await asyncio.sleep(0.2)
        if math.dist(before, await point(watcher)) < 1e-6:
            return before


async def travel(
    server: AppServer, sample: Sample, side: float, delay: float, *, grows: bool
) -> tuple[float, float, Stream]:
    """Return travel after letting go and the speed before [m, m/s], and the stream."""
    with DelayedLink(server.port, 0.0 if grows else delay) as link:
        async with aconnect(server.url, "Watcher") as watcher, stream(link) as hand:
            for number in range(round(STREAMED / PERIOD)):
                if grows:
                    link.delay = min(max(number * PERIOD - BEFORE, 0.0) * GROWTH, delay)
                await hand.say(sample(number, side))
                await asyncio.sleep(PERIOD)
            await hand.let_go()
            if grows:
                link.delay = delay
            before = await point(watcher)
            await asyncio.sleep(delay + 0.3)
            moved = math.dist(before, await rest(watcher))
        async with aconnect(server.url, "Home") as client:
            await client.ask(requests.Take())
            await asyncio.sleep(2.0 * SETTLE_TIME)
            await client.go(requests.Home())
    speed = SPEED if sample is not servo else RATE * math.hypot(*before[:2])
    return moved, speed, hand


def trials(server: AppServer, count: int) -> Iterator[str]:
    """Yield the rows of all samples and delays, of ``count`` trials each."""
    for sample in (jog, servo, step):
        quick = math.nan
        for delay, grows in ((0.0, False), *itertools.product(DELAYS[1:], (False, True))):
            runs = [
                asyncio.run(travel(server, sample, (-1.0) ** number, delay, grows=grows))
                for number in range(count)
            ]
            moved = max(run[0] for run in runs)
            quick = moved if delay == 0.0 else quick
            # Of a delay that grows, only samples that are not late are under way.
            waiting = runs[0][1] * (min(delay, Settings.sample_delay) if grows else delay)
            late = sum(len(run[2].late) for run in runs)
            executed = sum(len(run[2].late & run[2].executed) for run in runs)
            yield (
                f"| {sample.__name__} | {delay:g} | {'grows' if grows else 'constant'} "
                f"| {1e3 * moved:.1f} | {1e3 * waiting:.1f} | {1e3 * (1.2 * quick + waiting):.1f} "
                f"| {executed} of {late} |"
            )


async def many(server: AppServer, count: int) -> Stream:
    """Stream joint angles until ``count`` were late, on a connection whose delay jumps."""
    numbers = random.Random(450)
    with DelayedLink(server.port) as link:
        async with stream(link) as hand:
            until = 0.0
            while len(hand.late) < count:
                if time.monotonic() > until:
                    link.delay = numbers.choice((0.0, 0.1, 0.3, 1.0, 2.0))
                    until = time.monotonic() + numbers.uniform(0.5, 2.0)
                for _ in range(20):
                    await hand.say(servo(50, 0.0))
                    await asyncio.sleep(PERIOD / 4.0)
    return hand


def measure(count: int, late: int) -> None:
    """Print the table. ``count``: trials of each row. ``late``: late samples of the last one."""
    print(
        "| samples | delay, s | | travel, mm | under way, mm | limit, mm | late samples executed |"
    )
    with AppServer(SIMULATION_APP) as server:
        for row in trials(server, count):
            print(row, flush=True)
        hand = asyncio.run(many(server, late))
    executed = len(hand.late & hand.executed)
    in_time = len(hand.lateness) - len(hand.late)
    print(f"| servo | 0 to 2 | jumps | | | | {executed} of {len(hand.late)} |")
    print(f"Of the {in_time} samples in time, {len(hand.executed - hand.late)} were executed.")
