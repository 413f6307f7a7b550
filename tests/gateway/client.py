"""A simulated browser: both sockets of a page, byte for byte."""

from __future__ import annotations

import asyncio
import json
import secrets
import time
import urllib.request
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any
from urllib.error import HTTPError

import msgspec
import viser
import zstandard
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from katana450.arm.control.lease import HEARTBEAT_INTERVAL
from tests.browser.server import AppServer

SUBPROTOCOL = Subprotocol(f"viser-v{viser.__version__}")

LEARNT = 30.0
"""Timeout for receiving a scene [s]."""

QUIET = 0.4
"""Time [s] in which the server has sent all answers to a message."""

PAUSE = 0.1
"""Time [s] without a message after which a scene may be complete; its end shows that it is."""

FAREWELL = 0.5
"""Timeout for the server's close frame [s]."""

HOUR = 3600.0
"""One hour [s]."""

UPRIGHT = [1.0, 0.0, 0.0, 0.0]


def healthy(server: AppServer) -> bool:
    """Return whether ``server`` reports itself to be well."""
    with suppress(OSError):
        return ask(f"{server.url}/health")[0] == 200
    return False


def state_of(server: AppServer) -> dict[str, Any]:
    """Return the state of the arm."""
    state: dict[str, Any] = json.loads(ask(f"{server.url}/api/v1/state")[2])
    return state


def ask(
    url: str, *, data: bytes | None = None, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and body of any response; ``headers`` have _ for -."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        with urllib.request.urlopen(
            urllib.request.Request(url, data=data, headers=named), timeout=10
        ) as answer:
            return answer.status, dict(answer.headers), answer.read()
    except HTTPError as answer:
        with answer:
            return answer.code, dict(answer.headers), answer.read()


def enter(url: str, token: str = "") -> str:
    """Return the cookie of a new session."""
    body = json.dumps({"token": token}).encode()
    status, headers, answer = ask(f"{url}/enter", data=body, Origin=url)
    assert status == 204, answer
    return headers["set-cookie"].partition(";")[0]


def page_name() -> str:
    """Return a new key, as our page chooses one for itself."""
    return secrets.token_hex(16)


class _Websocket(connect):
    """A websocket with a timeout: plain ``close`` waits for ever if the server reads nothing."""

    async def __aexit__(self, *_error: object) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(2 * FAREWELL):
                await self.connection.close()
        self.connection.transport.abort()


def websocket(url: str, path: str, cookie: str = "", **options: Any) -> connect:
    """Return a context manager of a websocket; ``origin`` defaults to our own page."""
    origin = options.pop("origin", url)
    headers = {"Cookie": cookie} if cookie else {}
    headers |= options.pop("headers", {})
    return _Websocket(
        url.replace("http", "ws", 1) + path,
        origin=origin,
        additional_headers=headers,
        max_size=None,
        compression=None,
        # A client that stops reading does not get the close frame either.
        close_timeout=FAREWELL,
        **options,
    )


class Control:
    """The control socket of a page; it sends heartbeats while ``alive`` is True."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.heard: list[dict[str, Any]] = []
        self.status: dict[str, Any] = {}
        """All known values of the status."""
        self.alive = True
        self.last_beat = 0.0
        self._tasks = [
            asyncio.create_task(coroutine) for coroutine in (self._listen(), self._beat())
        ]

    async def say(self, do: str, **request: Any) -> None:
        """Send the request ``do``."""
        await self.socket.send(json.dumps({"do": do, **request}))

    async def wait(self, seconds: float = 5.0, **wanted: Any) -> dict[str, Any]:
        """Wait until the status has these values, and return it."""
        async with asyncio.timeout(seconds):
            while True:
                if self.status and all(self.status[key] == wanted[key] for key in wanted):
                    return self.status
                await asyncio.sleep(0.01)

    async def clear_stop(self) -> None:
        """Clear the stop once that is possible, and wait until it is cleared."""
        await self.wait(wait="")
        await self.say("clear_stop")
        await self.wait(stopped=None)

    async def notice(self, kind: str, seconds: float = 5.0) -> dict[str, Any]:
        """Wait for the first notice of ``kind``, remove it, and return it."""
        async with asyncio.timeout(seconds):
            while True:
                for message in self.heard:
                    if message["is"] == kind:
                        self.heard.remove(message)
                        return message
                await asyncio.sleep(0.01)

    async def close(self) -> None:
        """Stop the heartbeats and close the socket."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.socket.close()

    async def _listen(self) -> None:
        with suppress(ConnectionClosed):
            async for text in self.socket:
                message = json.loads(text)
                if message["is"] == "status":
                    self.status = self.status | message
                elif message["is"] != "echo":
                    self.heard.append(message)

    async def _beat(self) -> None:
        n = 0
        with suppress(ConnectionClosed):
            while True:
                if self.alive:
                    n += 1
                    await self.say("heartbeat", n=n)
                    self.last_beat = time.perf_counter()
                await asyncio.sleep(HEARTBEAT_INTERVAL)


class Peer:
    """A viser client that acknowledges no frames."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.controls: dict[str, dict[str, Any]] = {}

    async def listen(self, quiet: float = QUIET) -> list[dict[str, Any]]:
        """Return the messages that arrive until none does for ``quiet`` [s]."""
        heard: list[dict[str, Any]] = []
        while True:
            try:
                frame = await asyncio.wait_for(self.socket.recv(), quiet)
            except TimeoutError:
                return heard
            assert isinstance(frame, bytes)
            packed = int.from_bytes(frame[8:16], "little")
            body = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed])
            heard += msgspec.msgpack.decode(body)["messages"]

    async def learn(self) -> None:
        """Receive the scene and the panel, and send a camera, as a page does.

        viser counts a browser as connected from its first camera.
        """
        await self.say(
            type="ViewerCameraMessage",
            wxyz=UPRIGHT,
            position=[1.0, 0.0, 1.0],
            fov=0.7,
            near=0.01,
            far=100.0,
            image_height=800,
            image_width=1280,
            look_at=[0.0, 0.0, 0.0],
            up_direction=[0.0, 0.0, 1.0],
        )
        messages: list[dict[str, Any]] = []
        async with asyncio.timeout(LEARNT):
            # On a busy machine the scene arrives with pauses.
            while not any(message["type"] == "ReplayDoneMessage" for message in messages):
                messages += await self.listen(PAUSE)
        for message in messages:
            label = message.get("props", {}).get("label")
            if message["type"].startswith("Gui") and label:
                self.controls[label] = message

    async def say(self, **message: Any) -> None:
        await self.socket.send(msgspec.msgpack.encode(message))

    async def set(self, label: str, **updates: Any) -> None:
        """Change attributes of the control with ``label``."""
        uuid = self.controls[label]["uuid"]
        await self.say(type="GuiUpdateMessage", uuid=uuid, updates=updates)


@asynccontextmanager
async def controlling(
    url: str, cookie: str | None = None, page: str | None = None
) -> AsyncIterator[Control]:
    """Open the control socket of a page."""
    cookie = enter(url) if cookie is None else cookie
    async with websocket(url, f"/control?page={page or page_name()}", cookie) as socket:
        control = Control(socket)
        try:
            yield control
        finally:
            await control.close()


@asynccontextmanager
async def opened(url: str, token: str = "") -> AsyncIterator[tuple[Peer, Control]]:
    """Open both sockets of a page and receive its scene."""
    cookie, page = enter(url, token), page_name()
    async with (
        controlling(url, cookie, page) as control,
        websocket(url, f"/viser?page={page}", cookie, subprotocols=[SUBPROTOCOL]) as socket,
    ):
        peer = Peer(socket)
        await peer.learn()
        yield peer, control
