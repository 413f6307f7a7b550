"""The page's own socket: STOP, signs of life, the lease and jogging up, the status down.

It shares nothing with viser's, which holds back what is sent and forgets all but the newest.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections import deque
from contextlib import suppress
from typing import Any

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.errors import InputError, LeaseError
from app.gateway import requests, status
from app.gateway.bucket import Bucket
from app.gateway.door import NOT_YOU, Door
from app.gateway.hub import Hub, Window

log = logging.getLogger(__name__)

PAGE = re.compile(r"[A-Za-z0-9_-]{16,64}")
"""The name a page gives itself; nobody else can guess it."""

RATE, BURST = 100.0, 200.0
"""Requests a second, and at once: ten signs of life, 25 jogs, and a hand on the buttons."""

PUSH_EVERY = 0.1
"""[s] Between two looks at whether there is news."""

BAD_AT_MOST = 5
"""Requests that are none, until the socket is closed."""

NOTICES = 16
"""Answers that may wait for a slow line; of more, the oldest are forgotten."""

TOO_MUCH = 4429

GONE = (WebSocketDisconnect, RuntimeError)
"""What starlette raises when a socket is written to that is closed already."""


class ControlSocket:
    """One page's."""

    def __init__(self, hub: Hub, socket: WebSocket) -> None:
        self._hub = hub
        self._socket = socket
        self._notices: deque[dict[str, Any]] = deque(maxlen=NOTICES)
        self._news = asyncio.Event()
        self._bad = 0

    def tell(self, notice: dict[str, Any]) -> None:
        """Send ``notice`` as soon as the line allows."""
        self._notices.append(notice)
        self._news.set()

    async def run(self, window: Window) -> None:
        """Until the page goes."""
        tasks = [asyncio.create_task(each) for each in (self._send(window), self._receive(window))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            for ended in await asyncio.gather(*tasks, return_exceptions=True):
                if isinstance(ended, Exception) and not isinstance(ended, GONE):
                    log.error("A control socket met an error.", exc_info=ended)

    async def _receive(self, window: Window) -> None:
        bucket = Bucket(RATE, BURST, self._hub.clock())
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            try:
                if text is None:
                    raise InputError("A request is text.")
                request = requests.decoded(text)
            except InputError as error:
                self._bad += 1
                log.warning("A bad request of %s: %s", window.person.name, error)
                if self._bad >= BAD_AT_MOST:
                    await self._socket.close(1008, "Too many bad requests.")
                    return
                continue
            # A hand that hammers on STOP is never too fast.
            if not bucket.take(self._hub.clock()) and not isinstance(request, requests.Stop):
                log.warning("%s asks too much at once and is sent away.", window.person.name)
                await self._socket.close(TOO_MUCH, "Too many requests.")
                return
            try:
                self._do(window, request)
            except LeaseError as error:
                self.tell({"is": "refused", "why": str(error)})
            if not isinstance(request, requests.Beat | requests.Jog):
                self._news.set()

    def _do(self, window: Window, request: requests.AnyRequest) -> None:
        hub = self._hub
        hub.beat(window)
        match request:
            case requests.Beat(n=n):
                self.tell({"is": "echo", "n": n})
            case requests.Stop():
                hub.stop(window.person.name)
                self.tell({"is": "stopping"})
            case requests.Reset():
                hub.reset(window)
            case requests.Acquire():
                hub.acquire(window)
            case requests.Take():
                hub.take(window)
            case requests.Ask():
                hub.request(window)
            case requests.Withdraw():
                hub.withdraw(window)
            case requests.Release():
                hub.give_up(window)
            case requests.Give(to=number):
                hub.hand_over(window, number)
            case requests.Jog(rates=rates, frame=frame):
                hub.jog(window, rates, frame)
            case requests.Speed(value=value):
                hub.set_speed(window, value)

    async def _send(self, window: Window) -> None:
        """Notices at once, and what is new of the status; a slow line is told less often."""
        told: dict[str, Any] = {}
        looked_at = float("-inf")
        while True:
            with suppress(TimeoutError):
                async with asyncio.timeout(PUSH_EVERY):
                    await self._news.wait()
            self._news.clear()
            while self._notices:
                await self._say(self._notices.popleft())
            t = self._hub.clock()
            if t - looked_at < PUSH_EVERY / 2:
                continue
            looked_at = t
            now = status.common(self._hub) | status.of(self._hub, window)
            news = {key: value for key, value in now.items() if told.get(key, self) != value}
            if news:
                told = now
                await self._say({"is": "status", **news})

    async def _say(self, message: dict[str, Any]) -> None:
        await self._socket.send_text(msgspec.json.encode(message).decode())


async def serve(hub: Hub, door: Door, socket: WebSocket) -> None:
    """Answer a request for a control socket."""
    visitor = door.visitor(socket.cookies)
    page = socket.query_params.get("page", "")
    if visitor is None or not PAGE.fullmatch(page):
        await socket.accept()
        await socket.close(NOT_YOU, "Come in by the front page.")
        return
    await socket.accept()
    control = ControlSocket(hub, socket)
    window = hub.join(visitor, page, control.tell)
    try:
        await door.while_welcome(socket, control.run(window))
    finally:
        hub.leave(window)
