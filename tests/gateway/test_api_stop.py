"""Test STOP and silence while a program drives the arm of a real server."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable

import pytest

from katana450.client import AsyncClient, Client, RefusedError, aconnect, connect
from katana450.server.api import answers, requests
from tests.browser.server import AppServer
from tests.gateway.client import ask, websocket
from tests.gateway.postures import READY, THERE


def test_any_window_can_stop_a_program(server: AppServer, program: Client) -> None:
    program.ask(requests.Speed(value=0.2))
    program.ask(requests.Joints(q=THERE.tolist()))
    with connect(server.url, "Watcher") as other, pytest.raises(RefusedError, match=r"Test.*holds"):
        other.ask(requests.Home())
    status, _, _ = ask(f"{server.url}/api/v1/stop", data=b"", X_Name="bystander")
    assert status == 204
    assert program.query(answers.State).stopped == "bystander pressed STOP."
    with pytest.raises(RefusedError, match="clear the stop first"):
        program.joints(READY)
    end = time.monotonic() + 20.0
    while (rest := program.query(answers.State)).moving:
        assert time.monotonic() < end
        time.sleep(0.02)
    program.clear_stop()
    time.sleep(0.3)
    assert program.query(answers.State).q == rest.q
    event_log = program.query(answers.EventLog)
    assert any(line.who == "bystander" and line.began for line in event_log.lines)


def test_slow_watcher_learns_of_a_stop_at_once(server: AppServer, program: Client) -> None:
    def watched(reach: Callable[[answers.State], bool], act: Callable[[], object]) -> float:
        """Return the time from ``act`` until a watcher of a state per 10 s has such a state [s]."""

        async def watch() -> float:
            async with aconnect(server.url, "Watcher") as watcher, asyncio.timeout(15.0):
                states = watcher.states(0.1)
                await anext(states)
                began = time.monotonic()
                await asyncio.to_thread(act)
                async for state in states:
                    if reach(state):
                        return time.monotonic() - began
            raise AssertionError

        return asyncio.run(watch())

    program.ask(requests.Speed(value=0.2))
    program.ask(requests.Joints(q=THERE.tolist()))
    assert watched(lambda state: state.stop == "confirmed", program.stop) < 2.0
    # The stop can be cleared only at rest, and 1 s after it.
    assert watched(lambda state: state.stopped is None, program.clear_stop) < 4.0


def test_silent_program_causes_a_stop(server: AppServer) -> None:
    async def act() -> None:
        async with (
            websocket(server.url, "/api/v1/socket?name=Frozen") as silent,
            aconnect(server.url, "Watcher") as watcher,
        ):
            await silent.send('{"do": "speed", "value": 0.1}')
            await silent.send(json.dumps({"do": "joints", "q": THERE.tolist()}))
            async with asyncio.timeout(5.0):
                while (await watcher.query(answers.State)).stopped is None:
                    await asyncio.sleep(0.02)
            state = await watcher.query(answers.State)
            # A starved machine says so in the sentence.
            assert state.stopped is not None
            assert "Frozen" in state.stopped
            assert "while the arm moved." in state.stopped
            await _freed(watcher)
            await watcher.clear_stop()
            await watcher.go(requests.Home())

    asyncio.run(act())


async def _freed(client: AsyncClient) -> None:
    async with asyncio.timeout(10.0):
        while (await client.query(answers.State)).holder is not None:
            await asyncio.sleep(0.05)
