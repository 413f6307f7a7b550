"""Test thousands of broken messages at every socket: no crash, no motion, no other driver."""

from __future__ import annotations

import asyncio
import json
import math
import os
import random
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from operator import attrgetter
from typing import Any

import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from katana450.client import connect as connect_program
from katana450.server.api import answers, requests
from tests.browser.server import AppServer
from tests.gateway.client import (
    SUBPROTOCOL,
    UPRIGHT,
    controlling,
    enter,
    opened,
    page_name,
    websocket,
)
from tests.gateway.lines import Lines

MESSAGES = 10_000 if "KATANA450_LONG" in os.environ else 1_000
"""Number of mutants at all sockets together."""

PAUSE = 0.003
"""Time in which a line of JSON is read [s]."""

HERE = "127.0.0.1"

NASTY: tuple[Any, ...] = (
    None, True, -1, 2**63, -(2**31), 1e308, -0.0, "", "x" * 300, "\x00", "NaN", "../..", [], {},
    [[]], [0.0] * 5, [1e9] * 4, {"value": 1}, [None] * 3, "1 base turn", "/target/move",
)  # fmt: skip
NOT_JSON: tuple[Any, ...] = (math.nan, math.inf, -math.inf, b"\xff\xfe", b"")

JSON: list[dict[str, Any]] = [
    {"do": "joint", "axis": 1, "value": 0.5},
    {"do": "joints", "q": [0.1, -1.0, 1.2, 0.1, 0.0]},
    {"do": "servo", "q": [0.1, -1.0, 1.2, 0.1, 0.0], "qd": [0.0] * 5},
    {"do": "pose", "T": np.eye(4).tolist(), "frame": "base"},
    {"do": "jog", "rates": [0.1, 0.0, 0.0, 0.0, 0.0], "frame": "tool"},
    {"do": "place", "name": "cup", "T": np.eye(4).tolist()},
    {"do": "program", "text": "- home\n"},
    {"do": "clear_stop"},
    {"do": "release_lease"},
    {"do": "give", "to": 1},
    {"do": "speed", "value": 0.5},
    {"do": "query", "at": "arm"},
    {"do": "watch", "hz": 10},
]
"""Messages that are mutated. STOP is not among them, because every client may send it."""

VISER: list[dict[str, Any]] = [
    {"type": "TransformControlsDragStartMessage", "name": "/target/move", "owner": ""},
    {
        "type": "TransformControlsUpdateMessage",
        "name": "/target/move",
        "owner": "",
        "wxyz": UPRIGHT,
        "position": [0.3, 0.0, 0.2],
    },
    {"type": "GuiUpdateMessage", "uuid": "UUID", "updates": {"value": 12.0}},
    {"type": "Seen", "count": 3},
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
]

Send = Callable[[bytes], Awaitable[None]]


def changed(message: Any, rng: random.Random, nasty: tuple[Any, ...]) -> Any:
    """Return ``message`` with one of its parts replaced, removed, doubled or added."""
    if isinstance(message, dict) and message and rng.random() < 0.8:
        copy: dict[Any, Any] = {**message}
        key = rng.choice(list(copy))
        match rng.randrange(4):
            case 0:
                del copy[key]
            case 1:
                copy[f"{key}{rng.randrange(9)}"] = copy[key]
            case _:
                copy[key] = changed(copy[key], rng, nasty)
        return copy
    if isinstance(message, list) and message and rng.random() < 0.6:
        copied = list(message)
        place = rng.randrange(len(copied))
        copied[place : place + 1] = [changed(copied[place], rng, nasty)] * rng.randrange(3)
        return copied
    return rng.choice(nasty)


def broken(data: bytes, rng: random.Random) -> bytes:
    """Return ``data`` cut, with flipped bits, or with other bytes inserted."""
    if not data:
        return data
    place = rng.randrange(len(data))
    match rng.randrange(4):
        case 0:
            return data[:place]
        case 1:
            flipped = bytearray(data)
            for _ in range(rng.randint(1, 6)):
                flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
            return bytes(flipped)
        case 2:
            return data[:place] + rng.randbytes(rng.randint(1, 40)) + data[place:]
    return rng.randbytes(rng.randint(0, 200))


def json_mutant(rng: random.Random) -> bytes:
    """Return a broken request that is neither a valid STOP nor two lines."""
    message = rng.choice(JSON)
    for _ in range(rng.randint(1, 3)):
        message = changed(message, rng, NASTY)
    data = json.dumps(message).encode()
    data = broken(data, rng) if rng.random() < 0.5 else data
    return data.replace(b"\n", b" ").replace(b"stop", b"pots")


def viser_mutant(rng: random.Random, uuids: list[str]) -> bytes:
    message: Any = dict(rng.choice(VISER))
    if message["type"] == "GuiUpdateMessage":
        message["uuid"] = rng.choice(uuids)
    for _ in range(rng.randint(0, 3)):
        message = changed(message, rng, NASTY + NOT_JSON)
    with suppress(OverflowError):
        data = msgspec.msgpack.encode(message)
        return broken(data, rng) if rng.random() < 0.5 else data
    return b""


async def pour_in(count: int, mutant: Callable[[], bytes], line: Callable[[], Any]) -> int:
    """Send ``count`` mutants, on a new ``line`` after each close; return the number of lines."""
    sent = lines = 0
    while sent < count:
        lines += 1
        with suppress(ConnectionClosed, ConnectionError, InvalidHandshake):
            async with line() as send:
                while sent < count:
                    sent += 1
                    await send(mutant())
    return lines


@asynccontextmanager
async def web_line(url: str, path: str, **options: Any) -> AsyncIterator[Send]:
    """Open a websocket whose answers are ignored, with the other sockets that it needs."""
    page, cookie = page_name(), enter(url)
    async with AsyncExitStack() as stack:
        if "viser" in path:
            await stack.enter_async_context(controlling(url, cookie, page))
        opening = websocket(url, path.format(page=page), cookie, max_queue=None, **options)
        socket = await stack.enter_async_context(opening)

        async def send(data: bytes) -> None:
            await socket.send(data if options else data.decode(errors="replace"))
            # Once this is answered, all messages before it were read.
            await (await socket.ping())

        yield send


@asynccontextmanager
async def tcp_line(port: int) -> AsyncIterator[Send]:
    """Open a connection to the port for JSON lines, and send a valid ``hello``."""
    reader, writer = await asyncio.open_connection(HERE, port)
    ignoring = asyncio.create_task(reader.read())

    async def send(data: bytes) -> None:
        if ignoring.done():
            raise ConnectionError
        writer.write(data + b"\n")
        await writer.drain()
        await asyncio.sleep(PAUSE)

    try:
        await send(b'{"do":"hello","name":"Fuzz"}')
        yield send
    finally:
        ignoring.cancel()
        writer.close()
        await asyncio.gather(ignoring, writer.wait_closed(), return_exceptions=True)


async def storm(server: AppServer) -> list[int]:
    """Send mutants to all sockets at the same time; return the number of lines of each."""
    url, rngs = server.url, [random.Random(seed) for seed in range(4)]
    async with opened(url) as (peer, _):
        uuids = [control["uuid"] for control in peer.controls.values()]
    kinds: list[tuple[Callable[[], bytes], Callable[[], Any]]] = [
        (
            lambda: viser_mutant(rngs[0], uuids),
            lambda: web_line(url, "/viser?page={page}", subprotocols=[SUBPROTOCOL]),
        ),
        (lambda: json_mutant(rngs[1]), lambda: web_line(url, "/control?page={page}")),
        (lambda: json_mutant(rngs[2]), lambda: web_line(url, "/api/v1/socket?name=Fuzz")),
        (lambda: json_mutant(rngs[3]), lambda: tcp_line(Lines.port(server))),
    ]
    return await asyncio.gather(*(pour_in(MESSAGES // 4, *kind) for kind in kinds))


driver_values = attrgetter("q", "goal", "gripper", "tool", "speed", "holder", "stopped")
"""Returns the values of a state that only the driver may change."""


def test_broken_messages_cause_no_crash_and_no_motion(server: AppServer) -> None:
    with connect_program(server.url, "Driver") as arm:
        arm.ask(requests.Acquire())
        before = arm.query(answers.State)
        objects = arm.query(answers.Objects).objects
        counts = asyncio.run(storm(server))
        print(f"{MESSAGES} messages; lines it took: {counts}")
        after = arm.query(answers.State)
        assert driver_values(after) == driver_values(before)
        assert not after.moving
        assert arm.query(answers.Objects).objects == objects
        # The driver keeps the lease and can drive.
        q = np.add(before.q, (0.2, 0.0, 0.0, 0.0, 0.0))
        assert np.allclose(arm.joints(q).q, q, atol=1e-9)
    assert server.running
    assert "Traceback" not in server.output
    assert "met an error" not in server.output
