"""Test that every call of the client ends, whatever the server does."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import msgspec
import numpy as np
import pytest
from websockets.asyncio.server import ServerConnection, serve

from katana450.client import AsyncClient, aconnect
from katana450.client import client as clients
from katana450.client.files import LostError
from katana450.server.api import answers, requests

BOUND = 5.0
"""Maximum duration of a test [s], much longer than the timeouts set here."""

TIMEOUT = 0.3

Handler = Callable[[ServerConnection], Awaitable[None]]
Act = Callable[[AsyncClient], Awaitable[None]]


@pytest.fixture(autouse=True)
def _short_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "ANSWER_TIMEOUT", TIMEOUT)


async def _ask(client: AsyncClient) -> None:
    await client.ask(requests.Hold())


async def _states(client: AsyncClient) -> None:
    async for _ in client.states(100.0):
        pass


async def _send(client: AsyncClient) -> None:
    while True:
        await client.send(requests.Servo(q=np.full(1000, 0.1)))


WELCOME = msgspec.json.encode(
    answers.Welcome(name="x", number=1, role="admin", heartbeat=10.0)
).decode()


async def _mute(connection: ServerConnection) -> None:
    await connection.wait_closed()


async def _welcoming(connection: ServerConnection) -> None:
    await connection.send(WELCOME)
    # The server reads all requests and answers none.
    async for _ in connection:
        pass


async def _silent_watch(connection: ServerConnection) -> None:
    await connection.send(WELCOME)
    async for text in connection:
        request = msgspec.json.decode(text)
        if request["do"] == "watch":
            await connection.send(msgspec.json.encode({"is": "done", "id": request["id"]}).decode())


async def _deaf(connection: ServerConnection) -> None:
    await connection.send(WELCOME)
    connection.transport.pause_reading()
    await asyncio.sleep(2.0 * BOUND)


async def _babbling(connection: ServerConnection) -> None:
    await connection.send(WELCOME)
    await connection.send("{}")
    await connection.wait_closed()


@pytest.mark.parametrize(
    ("handler", "act"),
    [
        pytest.param(_mute, _ask, id="no welcome"),
        pytest.param(_welcoming, _ask, id="no answer"),
        pytest.param(_silent_watch, _states, id="no states"),
        pytest.param(_deaf, _send, id="nothing is read", marks=pytest.mark.long),
        pytest.param(_babbling, _states, id="another protocol"),
    ],
)
async def test_call_that_a_server_leaves_open_raises_an_error(handler: Handler, act: Act) -> None:
    async with serve(handler, "127.0.0.1", 0, compression=None, close_timeout=0.1) as server:
        port = server.sockets[0].getsockname()[1]
        async with asyncio.timeout(BOUND):
            with pytest.raises(LostError):
                async with aconnect(f"http://127.0.0.1:{port}") as client:
                    await act(client)
        server.close(close_connections=False)
        for connection in server.connections:
            connection.transport.abort()
