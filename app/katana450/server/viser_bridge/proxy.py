"""One browser's way to viser and back."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress

import viser
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from katana450.server.service.hub import Hub, key_of
from katana450.server.service.identity import Identity
from katana450.server.viser_bridge.flow import FlowControl
from katana450.server.viser_bridge.frames import FRAME_SLOT_HEADER, FrameSlot
from katana450.server.viser_bridge.guard import Guard
from katana450.server.viser_bridge.message_filter import FilterResult, MessageFilter, Ruling
from katana450.server.viser_bridge.viser_server import KEY_HEADER
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, Authenticator
from katana450.server.web.connection_limit import ConnectionLimit
from katana450.server.web.control_socket import PAGE

log = logging.getLogger(__name__)

SUBPROTOCOL = Subprotocol(f"viser-v{viser.__version__}")

PICTURES = 1000.0
"""A second, that go to all browsers together: what a core can send them. A crowd shares them; who
drives is not asked to."""

FRAME = 1.0 / 60.0
"""[s] Pictures come no faster anyway."""

LOOK_AGAIN = 0.1
"""[s] How soon a browser that is behind is looked at again, should it say nothing."""

BROWSERS, BROWSERS_EACH = 64, 16
"""Browsers that are shown the scene at one time, and those of one identity."""

REFUSALS_EVERY = 0.5
"""[s] A person who drags what is not theirs is told so, but not twenty times a second."""


class Proxy:
    """Joins browsers to viser, each by a connection of its own."""

    def __init__(
        self, hub: Hub, authenticator: Authenticator, guard: Guard, port: int, key: str
    ) -> None:
        """``port`` of viser on this machine, and the ``key`` to it."""
        self._hub = hub
        self._authenticator = authenticator
        self._guard = guard
        self._port = port
        self._key = key
        self._places = ConnectionLimit(BROWSERS, BROWSERS_EACH)

    async def serve(self, browser: WebSocket) -> None:
        """Answer a request for viser's socket."""
        identity = self._authenticator.identity(browser.cookies)
        if identity is None or SUBPROTOCOL not in browser.scope["subprotocols"]:
            await browser.close(1008)
            return
        with self._places.taken(identity.session) as free:
            if free:
                await self._serve(browser, identity)
            else:
                await browser.close(1013)

    async def _serve(self, browser: WebSocket, identity: Identity) -> None:
        page = browser.query_params.get("page", "")
        # Without our page around it viser can be looked at, and no more.
        key = key_of(identity, page) if PAGE.fullmatch(page) else ""
        line = _Line(self._hub, self._guard, browser, key)
        try:
            async with connect(
                f"ws://127.0.0.1:{self._port}",
                subprotocols=[SUBPROTOCOL],
                additional_headers={KEY_HEADER: self._key, FRAME_SLOT_HEADER: line.slot.name},
                user_agent_header=None,
                compression=None,
                max_size=None,
                max_queue=1,
                ping_interval=None,
            ) as upstream:
                await browser.accept(SUBPROTOCOL)
                if not await self._authenticator.while_welcome(
                    lambda: self._authenticator.identity(browser.cookies), line.run(upstream)
                ):
                    await browser.close(SIGN_IN_CLOSE_CODE, "Your link is no good any more.")
        except OSError as error:
            log.warning("viser does not answer: %s", str(error) or type(error).__name__)
            # Who has left meanwhile needs no farewell.
            with suppress(WebSocketDisconnect, RuntimeError):
                await browser.close(1013)


class _Line:
    """Between one browser and viser."""

    def __init__(self, hub: Hub, guard: Guard, browser: WebSocket, key: str) -> None:
        self._hub = hub
        self._guard = guard
        self.slot = FrameSlot(key, self._refuse)
        self._browser = browser
        self._key = key
        self._flow = FlowControl()
        self._room = asyncio.Event()
        self._told_at = float("-inf")
        self._due = float("-inf")
        self._unwelcome = False

    async def run(self, upstream: ClientConnection) -> None:
        """Until either side closes; ``upstream``: viser's."""
        self._hub.show(self._key, self._flow)
        ways = (self._down(), self._up(upstream), upstream.wait_closed())
        tasks = [asyncio.create_task(way) for way in ways]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                with suppress(ConnectionClosed, WebSocketDisconnect, WebSocketDisconnected):
                    task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            # A farewell would wait behind pictures that nobody fetches any more.
            upstream.transport.abort()
            self._hub.hide(self._flow)
        # Only now, or a picture could come after it.
        if self._unwelcome:
            with suppress(WebSocketDisconnect, WebSocketDisconnected):
                await self._browser.close(1008)

    async def _down(self) -> None:
        """Pictures, as fast as the browser sees them."""
        while True:
            await self._send(await self.slot.take())
            await asyncio.sleep(self._pause(self._hub.clock()))
            await self._wait_for_room()

    async def _wait_for_room(self) -> None:
        while not self._flow.has_room(self._hub.clock()):
            self._room.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(LOOK_AGAIN):
                    await self._room.wait()

    def _pause(self, t: float) -> float:
        """[s] Before the next picture, so that a crowd leaves time for whoever drives."""
        holder = self._hub.lease.holder
        fraction = self._hub.watching / PICTURES
        if fraction <= FRAME or (holder is not None and holder.key == self._key):
            return 0.0
        self._due = max(self._due + fraction, t)
        return self._due - t

    async def _up(self, upstream: ClientConnection) -> None:
        """What the message filter lets pass."""
        window = self._hub.window(self._key)
        who = window.person.name if window is not None else "a window without our page"
        message_filter = MessageFilter(self._guard, who, self._hub.clock())
        while True:
            # One message a turn of the loop, as in a conversation.
            await asyncio.sleep(0)
            message = await self._browser.receive()
            if message["type"] == "websocket.disconnect":
                return
            data = message.get("bytes")
            verdict = message_filter.judge(data, self._hub.clock())
            if verdict.ruling is Ruling.PASS and data is not None:
                self.slot.stamps.append(self._hub.gate.revocations)
                await upstream.send(data)
            elif verdict.ruling is Ruling.CLOSE or not self._note(verdict):
                log.warning("Closed a browser that sent too much that no page sends.")
                self._unwelcome = True
                return

    def _note(self, verdict: FilterResult) -> bool:
        """Take in which frames are on the screen; False for a browser that lies about it."""
        if verdict.seen is None:
            return True
        self._room.set()
        return self._flow.seen(verdict.seen, self._hub.clock())

    def _refuse(self, why: str) -> None:
        """Show in the browser's window why its gesture was refused."""
        window, t = self._hub.window(self._key), self._hub.clock()
        if window is not None and t - self._told_at >= REFUSALS_EVERY:
            self._told_at = t
            window.tell({"is": "refused", "why": why})

    async def _send(self, frame: bytes) -> None:
        await self._browser.send_bytes(frame)
        self._flow.sent(len(frame), self._hub.clock())
