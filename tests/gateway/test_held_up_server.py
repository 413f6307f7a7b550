"""Test a front end that is suspended repeatedly: only the arm of a dead driver stops."""

from __future__ import annotations

import asyncio
import json
import sys
import time
from datetime import datetime
from typing import Any

import pytest

from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import ask, websocket
from tests.gateway.postures import FAR

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        sys.platform != "linux", reason="finds the server's processes as Linux lists them"
    ),
]

SILENCE = 1.0
HELD_UP = 0.6
"""Duration of each suspension [s], longer than half the heartbeat timeout."""

LOADED = 3.0
"""Total duration of the load [s]."""


# With a dead driver the server is awake for less than two checks. With a live one it is awake for
# long enough to send a heartbeat to the arm.
@pytest.mark.parametrize(("alive", "awake"), [(False, 0.01), (True, 0.1)])
def test_only_a_dead_driver_is_silent(alive: bool, awake: float) -> None:
    async def act(server: AppServer) -> None:
        async with websocket(server.url, "/api/v1/socket?name=Driver") as driver:

            async def heartbeat(seconds: float) -> None:
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    await driver.send('{"do": "heartbeat"}')
                    await asyncio.sleep(0.1)

            await driver.send('{"do": "speed", "value": 0.1}')
            await driver.send(json.dumps({"do": "joints", "q": FAR.tolist()}))
            await heartbeat(0.5)
            last = time.time()
            holding_up = asyncio.create_task(asyncio.to_thread(hold_up, server, awake))
            if alive:
                await heartbeat(LOADED)
            await holding_up
            if alive:
                await heartbeat(0.3)
                assert look(server, "state")["stopped"] is None
                return
        state = look(server, "state")
        # The server was late, but the kernel knows when messages arrived.
        assert "No message of Driver arrived" in state["stopped"]
        took = datetime.fromisoformat(await stop_time(server)).timestamp() - last
        # The stop comes as soon as the server is awake, not after the end of the load.
        assert took < SILENCE + 2 * HELD_UP

    with AppServer((*ATTENTIVE_APP, "--silence", str(SILENCE))) as server:
        asyncio.run(act(server))


async def stop_time(server: AppServer) -> str:
    """Return the time of the newest stop in the event log, which follows the state."""
    async with asyncio.timeout(5.0):
        while True:
            for line in reversed(look(server, "event_log")["lines"]):
                if line["began"] and line["finding"]["reason"] == "stopped":
                    when: str = line["when"]
                    return when
            await asyncio.sleep(0.02)


def hold_up(server: AppServer, awake: float) -> None:
    """Suspend the front end again and again, and the supervisor that would end it."""
    end = time.monotonic() + LOADED
    while time.monotonic() < end:
        with server.frozen(server.front):
            time.sleep(HELD_UP)
        time.sleep(awake)


def look(server: AppServer, at: str) -> Any:
    return json.loads(ask(f"{server.url}/api/v1/{at}")[2])
