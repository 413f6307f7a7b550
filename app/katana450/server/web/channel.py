"""Requests up, answers down.

The line shares nothing with viser's, which holds back what is sent and forgets all but the newest.
"""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections import deque
from contextlib import suppress
from typing import Any, Protocol

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from katana450.errors import InputError, LeaseError
from katana450.server.api import answers, requests
from katana450.server.api.fields import Id
from katana450.server.service.budget import Budget, BusyError
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.heartbeats import Arrival
from katana450.server.service.hub import Hub, Window
from katana450.server.web.admission import LIMIT_CLOSE_CODE
from katana450.server.web.token_bucket import TokenBucket

log = logging.getLogger(__name__)

ARRIVAL = "katana450.arrival"
"""Where a websocket's scope has its ``Arrival``."""

MAX_WAITING_ANSWERS = 64
"""Answers that may wait for a slow line; of more, the oldest are forgotten."""

BAD_REQUEST_CLOSE_CODE = 1008
"""Close code for who says what is no request, again and again."""

CLOSE_FRAME_TIMEOUT = 1.0
"""[s] That who is sent away has for being told so: who reads nothing cannot be told."""


class GoneError(Exception):
    """The other side has hung up."""


class JsonChannel(Protocol):
    """Texts both ways. Each method raises GoneError once the other side is."""

    @property
    def arrival(self) -> Arrival: ...

    async def receive(self) -> str | bytes: ...

    async def send(self, text: str) -> None: ...

    async def close(self, code: int, why: str, /) -> None: ...


class WebSocketJsonChannel:
    """A websocket, accepted."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        arrival: Arrival | None = socket.scope.get(ARRIVAL)
        self.arrival = Arrival(None) if arrival is None else arrival

    async def receive(self) -> str | bytes:
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise GoneError
        # Binary messages are no requests, which is said of an empty text too.
        return message.get("text") or ""

    async def send(self, text: str) -> None:
        try:
            await self._socket.send_text(text)
        except (WebSocketDisconnect, RuntimeError) as error:
            raise GoneError from error

    async def close(self, code: int, why: str) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            await self._socket.close(code, why)


class Channel(ABC):
    """One window's; what is told unasked is its kind's."""

    def __init__(
        self, hub: Hub, line: JsonChannel, budget: Budget, *, often: TokenBucket, bad: TokenBucket
    ) -> None:
        """``budget``: of whoever asks, and of all their other windows. ``often``: how much may be
        asked here. ``bad``: how much of it may be nonsense.
        """
        self.hub = hub
        self.budget = budget
        self._dispatcher = Dispatcher(hub)
        self._line = line
        self._often = often
        self._bad = bad
        self._notices: deque[Any] = deque(maxlen=MAX_WAITING_ANSWERS)
        self._news = asyncio.Event()
        self._concluding: set[asyncio.Task[None]] = set()

    def tell(self, notice: Any) -> None:
        """Send ``notice``, anything that is JSON, as soon as the line allows."""
        self._notices.append(notice)
        self._news.set()

    @abstractmethod
    def unasked(self) -> tuple[Any, float | None]:
        """What is to be told now, None for nothing; and in how long there may be more [s]."""

    def answer(self, window: Window, request: requests.Request) -> None:
        """Do it and tell the answer, if the request has an id or is a question."""
        answer = self._dispatcher.handle(window, request, self.budget)
        told = request.id is not None or request.traits.answered
        if self._dispatcher.is_pending(answer):
            task = asyncio.ensure_future(self._conclude(answer, told=told))
            self._concluding.add(task)
            task.add_done_callback(self._concluding.discard)
        elif told:
            self.tell(answer)

    async def _conclude(self, pending: answers.Answer, *, told: bool) -> None:
        """Tell what became of a command, or only that it is refused."""
        answer = await self._dispatcher.concluded(pending)
        if told or isinstance(answer, answers.Refused):
            self.tell(answer)

    async def run(self, window: Window) -> None:
        """Until one side hangs up."""
        tasks = [asyncio.create_task(each) for each in (self._send(), self._receive(window))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (*tasks, *self._concluding):
                task.cancel()
            for ended in await asyncio.gather(*tasks, *self._concluding, return_exceptions=True):
                if isinstance(ended, Exception) and not isinstance(ended, GoneError):
                    log.error("A conversation met an error.", exc_info=ended)

    async def _receive(self, window: Window) -> None:
        while True:
            # One request a turn of the loop: who has sent a thousand keeps nobody else waiting.
            await asyncio.sleep(0)
            text = await self._line.receive()
            try:
                request = self.hub.requests.decoded(text)
            except InputError as error:
                log.warning("A bad request of %s: %s", window.person.name, error)
                if not self._bad.take(self.hub.clock()):
                    await self._send_away(BAD_REQUEST_CLOSE_CODE, "Too many bad requests.")
                    return
                self.refuse(str(error), requests.id_of(text))
                continue
            # A hand that hammers on STOP is never too fast.
            if not self._often.take(self.hub.clock()) and not request.traits.safety:
                log.warning("%s asks too much at once and is sent away.", window.person.name)
                await self._send_away(LIMIT_CLOSE_CODE, "Too many requests.")
                return
            try:
                self.answer(window, request)
            except BusyError as error:
                if error.gone:
                    log.warning("%s asks on regardless and is sent away.", window.person.name)
                    await self._send_away(LIMIT_CLOSE_CODE, str(error))
                    return
                self.refuse(str(error), request.id, retry=error.retry)
            except (LeaseError, InputError) as error:
                self.refuse(str(error), request.id)

    async def _send_away(self, code: int, why: str) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_FRAME_TIMEOUT):
                await self._line.close(code, why)

    def refuse(self, why: str, named: Id, **more: float) -> None:
        """Say that what was asked is not done. ``more``: of ``answers.Refused``."""
        self.tell({"is": "refused", "why": why, "id": named, **more})

    def wake(self) -> None:
        """There may be something to tell now."""
        self._news.set()

    async def _send(self) -> None:
        while True:
            self._news.clear()
            while self._notices:
                await self._say(self._notices.popleft())
            notice, again = self.unasked()
            if notice is not None:
                await self._say(notice)
            with suppress(TimeoutError):
                async with asyncio.timeout(again):
                    await self._news.wait()

    async def _say(self, notice: Any) -> None:
        await self._line.send(msgspec.json.encode(notice).decode())
