"""Channels that receive requests and send answers, and the control socket of a page.

They are separate from the connections of viser, which delays messages and keeps only the newest.
"""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, ClassVar, Protocol

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from katana450.arm.control.commands.act import Id
from katana450.errors import InputError, LateError, LeaseError
from katana450.server.api import answers, requests
from katana450.server.service import status
from katana450.server.service.budget import Budget, Budgets, BusyError
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.heartbeats import ARRIVAL, LATE_RETRY, PING, LastHeartbeat
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE, Identity
from katana450.server.service.limits import TokenBucket
from katana450.server.service.participants import Participant
from katana450.server.service.pending_answer import PendingAnswer
from katana450.server.web.admission import LIMIT_CLOSE_CODE, address_of
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, Authenticator

log = logging.getLogger(__name__)

MAX_WAITING_ANSWERS = 64
"""Maximum number of answers that wait for a slow connection; beyond it the oldest are dropped."""

BAD_REQUEST_CLOSE_CODE = 1008
"""Close code for a client that sends too many invalid requests."""

CLOSE_FRAME_TIMEOUT = 1.0
"""Timeout [s] for sending the close frame: some clients never read it."""


PAGE_REQUESTS = 160.0, 320.0
"""Maximum rate [1/s] and burst of requests: per second ten heartbeats, 25 jogs, 30 queries, and the
use of knobs and buttons."""

PUSH_EVERY = 0.1
"""Interval [s] of status updates; twice as long while nobody drives."""

PAGE_BAD_REQUESTS = 0.0, 4.0
"""The same of invalid requests: the fifth closes the socket."""


class GoneError(Exception):
    """Raised when the other side has closed the connection."""


class JsonChannel(Protocol):
    """Exchange of JSON texts. ``receive`` and ``send`` raise GoneError on a closed connection."""

    @property
    def arrival(self) -> LastHeartbeat:
        """Newest heartbeat on the connection, by the time of its receipt."""

    async def receive(self) -> str | bytes:
        """Return the next message."""

    async def send(self, text: str) -> None:
        """Send ``text``."""

    async def close(self, code: int, why: str, /) -> None:
        """Close the connection with a close code and a reason."""


class WebSocketJsonChannel:
    """JSON texts on an accepted websocket."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        arrival: LastHeartbeat | None = socket.scope.get(ARRIVAL)
        self.arrival = LastHeartbeat() if arrival is None else arrival
        self.ping: Callable[[], None] = socket.scope.get(PING, lambda: None)

    async def receive(self) -> str | bytes:
        """Return the next message. Raises GoneError on a closed connection."""
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise GoneError
        # A binary message becomes an empty text, which is refused as an invalid request.
        return message.get("text") or ""

    async def send(self, text: str) -> None:
        """Send ``text``. Raises GoneError on a closed connection."""
        try:
            await self._socket.send_text(text)
        except (WebSocketDisconnect, RuntimeError) as error:
            raise GoneError from error

    async def close(self, code: int, why: str) -> None:
        """Close the websocket with the close code ``code`` and the reason ``why``."""
        with suppress(WebSocketDisconnect, RuntimeError):
            await self._socket.close(code, why)


class Channel(ABC):
    """Channel of one participant. A subclass decides which messages are sent without a request.

    Attributes:
        often: Maximum rate [1/s] and burst of all requests.
        bad: The same of invalid requests.
    """

    often: ClassVar[tuple[float, float]]
    bad: ClassVar[tuple[float, float]]

    def __init__(self, hub: Hub, line: JsonChannel, budget: Budget) -> None:
        """Create a channel on ``line``.

        ``budget``: that of the identity, which all its participants share.
        """
        self.hub = hub
        self.budget = budget
        self.participant: Participant | None = None
        self._dispatcher = Dispatcher(hub)
        self._line = line
        t = hub.clock()
        self._often, self._bad = TokenBucket(*self.often, t), TokenBucket(*self.bad, t)
        self._notices: deque[Any] = deque(maxlen=MAX_WAITING_ANSWERS)
        self._news = asyncio.Event()
        self._urgent = False
        self._concluding: set[asyncio.Task[None]] = set()

    def greet(self, participant: Participant) -> None:
        """Take ``participant``, whose channel this is."""
        self.participant = participant

    async def serve(
        self,
        authenticator: Authenticator,
        identity: Callable[[], Identity | None],
        participant: Participant,
    ) -> None:
        """Serve ``participant`` until one side closes, or until it is no longer authorised.

        ``identity``: returns its identity, None once that has expired.
        """
        why = await authenticator.run_while_authorised(identity, self.run(participant))
        if why is not None:
            self.hub.recorder.note("revocation", participant.actor, always=True, why=why)
            await self._line.close(SIGN_IN_CLOSE_CODE, why)

    def notify(self, notice: Any) -> None:
        """Queue ``notice``, any JSON value; send it as soon as the connection allows."""
        self._notices.append(notice)
        self._news.set()

    def decoded(self, text: str | bytes) -> Any:
        """Return the request in ``text``. Raises InputError with the reason if it is invalid."""
        return self.hub.requests.decoded(text)

    def id_of(self, text: str | bytes) -> Any:
        """Return the id in ``text``, which need not be a valid request; None without one."""
        return requests.id_of(text)

    @abstractmethod
    def unasked(self, *, urgent: bool) -> tuple[Any, float | None]:
        """Return the message to send now, or None, and the time until the next call [s].

        ``urgent``: a stop has begun, was confirmed or was cleared since the last call.
        """

    def answer(self, participant: Participant, request: requests.Request) -> None:
        """Execute ``request``; send the answer if it has an id or is always answered."""
        answer = self._dispatcher.handle(participant, request, self.budget)
        wanted = request.id is not None or request.traits.answered
        if isinstance(answer, PendingAnswer):
            task = asyncio.ensure_future(self._conclude(answer, wanted=wanted or answer.waits))
            self._concluding.add(task)
            task.add_done_callback(self._concluding.discard)
        elif wanted:
            self.notify(answer)

    async def _conclude(self, pending: PendingAnswer, *, wanted: bool) -> None:
        """Send the outcome of a command; if no answer is ``wanted``, only a refusal."""
        answer = await pending.answer()
        if wanted or isinstance(answer, answers.Refused):
            self.notify(answer)

    async def run(self, participant: Participant) -> None:
        """Receive and send until one side closes the connection."""
        tasks = [
            asyncio.create_task(coroutine)
            for coroutine in (self._send(), self._receive(participant))
        ]
        self.hub.stop_news.listeners.add(self._hurry)
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.hub.stop_news.listeners.discard(self._hurry)
            for task in (*tasks, *self._concluding):
                task.cancel()
            for ended in await asyncio.gather(*tasks, *self._concluding, return_exceptions=True):
                if isinstance(ended, Exception) and not isinstance(ended, GoneError):
                    log.error("Error on a channel.", exc_info=ended)

    async def _receive(self, participant: Participant) -> None:
        while True:
            # One request per turn of the loop, so that a flooding client does not delay others.
            await asyncio.sleep(0)
            text = await self._line.receive()
            try:
                request = self.decoded(text)
            except InputError as error:
                log.warning("Invalid request from %s: %s", participant.person.name, error)
                self.hub.recorder.refuse("invalid", participant.actor, error)
                if not self._bad.take(self.hub.clock()):
                    await self._disconnect(BAD_REQUEST_CLOSE_CODE, "Too many invalid requests.")
                    return
                self.refuse(str(error), self.id_of(text))
                continue
            # STOP is exempt from the rate limit.
            if not self._often.take(self.hub.clock()) and not request.traits.safety:
                log.warning("%s sends too many requests: disconnected.", participant.person.name)
                self.hub.recorder.refuse("any", participant.actor, InputError("Too many requests."))
                await self._disconnect(LIMIT_CLOSE_CODE, "Too many requests.")
                return
            try:
                self.answer(participant, request)
            except BusyError as error:
                if error.gone:
                    log.warning("%s exceeds its budget: disconnected.", participant.person.name)
                    await self._disconnect(LIMIT_CLOSE_CODE, str(error))
                    return
                self.refuse(str(error), request.id, retry=error.retry)
            except LateError as error:
                self.refuse(str(error), request.id, retry=LATE_RETRY)
            except (LeaseError, InputError) as error:
                self.refuse(str(error), request.id)

    async def _disconnect(self, code: int, why: str) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_FRAME_TIMEOUT):
                await self._line.close(code, why)

    def refuse(self, why: str, request_id: Id, **more: float) -> None:
        """Send a refusal of the request of ``request_id``. ``more``: fields of ``Refused``."""
        self.notify({"is": "refused", "why": why, "id": request_id, **more})

    def wake(self) -> None:
        """Wake the sender, because there may be a message to send."""
        self._news.set()

    def _hurry(self) -> None:
        self._urgent = True
        self.wake()

    async def _send(self) -> None:
        while True:
            self._news.clear()
            while self._notices:
                await self._send_json(self._notices.popleft())
            urgent, self._urgent = self._urgent, False
            notice, pause = self.unasked(urgent=urgent)
            if notice is not None:
                await self._send_json(notice)
            with suppress(TimeoutError):
                async with asyncio.timeout(pause):
                    await self._news.wait()

    async def _send_json(self, notice: Any) -> None:
        await self._line.send(msgspec.json.encode(notice).decode())


class ControlSocket(Channel):
    """Control socket of one page: it receives requests such as STOP and jog.

    It sends changes of the status, less often if it is slow. States are sent only on request, a few
    at a time, so a slow connection has no backlog of them.
    """

    often, bad = PAGE_REQUESTS, PAGE_BAD_REQUESTS

    def __init__(self, hub: Hub, line: JsonChannel, budget: Budget) -> None:
        super().__init__(hub, line, budget)
        self._sent: dict[str, Any] = {}
        self._checked_at = float("-inf")

    def answer(self, participant: Participant, request: requests.Request) -> None:
        """Execute ``request``, send its answer, and confirm the receipt of a stop."""
        super().answer(participant, request)
        if isinstance(request, requests.Stop):
            self.notify({"is": "stopped"})
        if not isinstance(request, requests.Heartbeat | requests.Jog):
            self.wake()

    def unasked(self, *, urgent: bool) -> tuple[Any, float | None]:
        """Return the changes of the status, or None, and the time until the next call [s]."""
        t = self.hub.clock()
        pause = PUSH_EVERY if self.hub.lease.holder is not None else 2 * PUSH_EVERY
        if self.participant is None or (not urgent and t - self._checked_at < PUSH_EVERY / 2):
            return None, pause
        self._checked_at = t
        now = status.common(self.hub) | status.of(self.hub, self.participant)
        changes = {key: value for key, value in now.items() if self._sent.get(key, self) != value}
        self._sent = now
        return {"is": "status", **changes} if changes else None, pause


async def serve_page(
    hub: Hub, authenticator: Authenticator, budgets: Budgets, socket: WebSocket
) -> None:
    """Serve an accepted control socket until it closes or its client is no longer authorised."""
    identity = authenticator.identity(socket.cookies)
    page = socket.query_params.get("page", "")
    if identity is None or not PAGE.fullmatch(page):
        await socket.close(SIGN_IN_CLOSE_CODE, "Sign in at the start page first.")
        return
    line = WebSocketJsonChannel(socket)
    control = ControlSocket(hub, line, budgets.of(identity.session))
    identity = replace(identity, address=address_of(socket))
    participant = hub.join(identity, page, control.notify, line.arrival)
    control.greet(participant)
    try:
        await control.serve(
            authenticator, lambda: authenticator.identity(socket.cookies), participant
        )
    finally:
        hub.leave(participant)
