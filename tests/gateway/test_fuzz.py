"""Test thousands of broken messages: no crash, no motion, no other driver."""

from __future__ import annotations

import asyncio
import json
import math
import os
import random
from contextlib import suppress
from operator import attrgetter
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed

from katana450.server.api import answers, requests
from katana450.server.viser_bridge.guard import Guard, MessageFilter, Ruling
from tests.gateway.client import UPRIGHT
from tests.gateway.virtual import VirtualServer
from tests.viser_bridge import internals

MESSAGES = 10_000 if "KATANA450_LONG" in os.environ else 1_000
"""Number of mutants of each kind."""

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
    """Return a broken request that is no valid STOP."""
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


async def storm(server: VirtualServer, rng: random.Random) -> None:
    """Send mutants on websockets of programs, each of which ends after some."""
    sent = 0
    while sent < MESSAGES:
        socket = await server.program_socket("Fuzz")
        with suppress(ConnectionClosed):
            for _ in range(20):
                sent += 1
                await socket.send(json_mutant(rng).decode(errors="replace"))
                await asyncio.sleep(0.01)
        await socket.close()


driver_values = attrgetter("q", "goal", "gripper", "tool", "speed", "holder", "stopped")
"""Returns the values of a state that only the driver may change."""


def test_broken_requests_cause_no_crash_and_no_motion(
    local: VirtualServer, caplog: pytest.LogCaptureFixture
) -> None:
    with local.connect("Driver") as arm:
        arm.ask(requests.Acquire())
        before = arm.query(answers.State)
        objects = arm.query(answers.Objects).objects
        local.run(storm(local, random.Random(450)))
        after = arm.query(answers.State)
        assert driver_values(after) == driver_values(before)
        assert not after.moving
        assert arm.query(answers.Objects).objects == objects
        # The driver keeps the lease and can drive.
        q = np.add(before.q, (0.2, 0.0, 0.0, 0.0, 0.0))
        assert np.allclose(arm.joints(q).q, q, atol=1e-9)
    assert not [record for record in caplog.records if record.exc_info]


def test_broken_messages_of_viser_are_dropped() -> None:
    rng, server = random.Random(451), viser.ViserServer(port=0, verbose=False)
    try:
        server.scene.add_transform_controls("/target/move")
        slider = server.gui.add_slider("S", min=0.0, max=20.0, step=0.1, initial_value=0.0)
        uuid = internals.value_change(slider, 1.0).uuid
        message_filter = MessageFilter(Guard(server), "a test", 0.0)
        for number in range(MESSAGES):
            data = viser_mutant(rng, [uuid])
            result = message_filter.judge(data, 100.0 * number)
            if result.ruling is Ruling.PASS:
                assert type(result.message).__name__ in {entry["type"] for entry in VISER[:3]}
    finally:
        server.stop()
