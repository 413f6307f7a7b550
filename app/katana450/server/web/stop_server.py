"""Server of STOP alone, in a process that shares nothing with the web server.

It accepts ``POST /stop`` of pages, ``POST /api/v1/stop`` of programs, and ``GET /health``. Each
connection carries one request. STOP is passed to the arm's process at once. The only file that it
needs is the access file: each STOP does a ``stat`` of it, and reads it after a change.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import time
from collections.abc import Mapping
from contextlib import nullcontext
from http import HTTPStatus
from typing import NamedTuple, cast
from urllib.parse import parse_qs, urlsplit

import h11
import msgspec

from katana450.arm.control.lease import Actor, CommandChannel, Grounds, Person
from katana450.arm.control.state.stop_cause import UNNAMED, StopCause, pressed
from katana450.arm.runtime.pipes.stop_messages import NO_STATE, StopPress
from katana450.arm.runtime.pipes.stop_pipe import StopPipe
from katana450.server.api.fields import API, MAX_PRESS_LENGTH, STOP_PATHS
from katana450.server.api.outcome_answers import Refused
from katana450.server.service.identity import PAGE, Identity
from katana450.server.service.limits import SenderBuckets
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import (
    UNKNOWN_HOST,
    Address,
    Authenticator,
    framing_fault,
)

log = logging.getLogger(__name__)

CONFIRM_TIMEOUT = 0.5
"""[s] Timeout for a state of the arm that confirms the stop."""

RATE, BURST = 10.0, 20.0
"""Requests of one client per second, and in a burst, beyond which answers are delayed: refusals,
and presses while the arm is stopped already. A press that finds the arm not stopped is never
delayed. A client is an access link; without one, an address."""

MAX_CLIENTS = 256
"""Number of clients whose requests are counted; a new one replaces the oldest."""

DELAY = 0.2
"""[s] Delay of these answers. Meanwhile the connection may be closed in favour of another."""

MAX_KEPT = 32
"""Maximum number of connections that wait for a confirmation and are not closed for others."""

MAX_HEAD_BYTES = 8192
"""Maximum size of a request without its body [bytes]."""

LINGER = 0.5
"""[s] Time in which the body of an answered request is received, and dropped."""

HEADERS = (
    ("cache-control", "no-store"),
    ("connection", "close"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
)
"""Headers of every answer."""


class Reply(NamedTuple):
    """Response to a request."""

    status: int
    body: bytes
    media_type: str = "text/plain; charset=utf-8"
    headers: tuple[tuple[str, str], ...] = ()


def refused(path: str, status: int, why: str) -> Reply:
    """Return the refusal of a request for ``path``: of the API as JSON, else as text."""
    if not path.startswith(API):
        return Reply(status, why.encode())
    answer = Refused(why=why).with_status(status)
    return Reply(status, msgspec.json.encode(answer) + b"\n", "application/json")


class StopServer:
    """Decides each request of the port of STOP."""

    def __init__(
        self,
        pipe: StopPipe,
        authenticator: Authenticator,
        address: Address,
        main_port: int,
        acceptor: Acceptor,
    ) -> None:
        """Serve ``pipe``. ``main_port``: port of the pages that may send STOP to this one."""
        self._pipe = pipe
        self._authenticator = authenticator
        self._address = address
        self._main_port = main_port
        self._acceptor = acceptor
        self._often = SenderBuckets(RATE, BURST, MAX_CLIENTS)
        self._kept = 0

    async def reply(self, request: h11.Request, client: tuple[str, int] | None) -> Reply:
        """Execute ``request`` of ``client`` and return its response."""
        headers = {name.decode("latin-1"): text.decode("latin-1") for name, text in request.headers}
        path, _, query = request.target.decode("latin-1").partition("?")
        origin = headers.get("origin")
        if fault := framing_fault(headers):
            return await self.delayed(refused(path, HTTPStatus.BAD_REQUEST, fault), client)
        refusal = self._refusal(request.method, path, headers.get("host", ""), origin)
        if refusal is not None:
            return await self.delayed(refusal, client)
        if path not in STOP_PATHS:
            return self._health()
        identity = self._identity(path, headers)
        if identity is None:
            why = "Sign in at the start page, or send a token."
            reply = refused(path, HTTPStatus.UNAUTHORIZED, why)
            return await self.delayed(_readable_by(origin, reply), client)
        parameters = {name: values[0] for name, values in parse_qs(query).items()}
        press = parameters.get("press", "")[:MAX_PRESS_LENGTH]
        page = parameters.get("page", "") if path == STOP_PATHS[0] else ""
        channel = CommandChannel.PAGE if path == STOP_PATHS[0] else CommandChannel.HTTP
        return _readable_by(origin, await self._stop(identity, channel, press, client, page))

    async def delayed(self, reply: Reply, client: tuple[str, int] | None) -> Reply:
        """Return the refusal ``reply``, after ``DELAY`` if ``client`` gets too many."""
        if not self._takes(_address_of(client)):
            await asyncio.sleep(DELAY)
        return reply

    def _takes(self, who: str) -> bool:
        """Count a request of ``who``; return False if there are too many."""
        return self._often.take(who, time.monotonic())

    def _refusal(self, method: bytes, path: str, host: str, origin: str | None) -> Reply | None:
        if not self._address.is_ours(host):
            return refused(path, HTTPStatus.FORBIDDEN, UNKNOWN_HOST)
        if path not in (*STOP_PATHS, "/health"):
            return refused(path, HTTPStatus.NOT_FOUND, "This port serves STOP alone.")
        allowed = "POST" if path in STOP_PATHS else "GET"
        if method.decode("latin-1") != allowed:
            reply = refused(path, HTTPStatus.METHOD_NOT_ALLOWED, f"Send {allowed}.")
            return reply._replace(headers=(("allow", allowed),))
        if path not in STOP_PATHS:
            return None
        if origin is None:
            # Programs have no Origin header, but browsers send one.
            missing = refused(path, HTTPStatus.FORBIDDEN, "The header Origin is missing.")
            return missing if path == STOP_PATHS[0] else None
        if not self._is_our_page(origin, host):
            why = "Pages of other sites may not send this request."
            return refused(path, HTTPStatus.FORBIDDEN, why)
        return None

    def _is_our_page(self, origin: str, host: str) -> bool:
        """Return whether ``origin`` is that of our page, on the main port of the same host."""
        if origin == self._address.public:
            return True
        scheme = "https" if self._address.secure else "http"
        try:
            page, name = urlsplit(origin), urlsplit(f"//{host}").hostname
            port = page.port or (443 if self._address.secure else 80)
        except ValueError:
            return False
        return (page.scheme, page.hostname, port) == (scheme, name, self._main_port)

    def _identity(self, path: str, headers: Mapping[str, str]) -> Identity | None:
        cookies = dict(
            part.strip().partition("=")[::2] for part in headers.get("cookie", "").split(";")
        )
        if path == STOP_PATHS[0]:
            return self._authenticator.identity(cookies)
        return self._authenticator.program(
            headers.get("x-name", ""), headers.get("authorization", ""), cookies
        )

    async def _stop(
        self,
        identity: Identity,
        channel: CommandChannel,
        press: str,
        client: tuple[str, int] | None,
        page: str = "",
    ) -> Reply:
        """Send STOP to the arm, and return whether a state has confirmed it.

        ``press``: empty for a new press. ``page``: the page that sends it; empty for a program.
        """
        pipe = self._pipe
        key = f"{identity.session}/{page}" if PAGE.fullmatch(page) else identity.session
        name = identity.name or UNNAMED
        press = press or secrets.token_urlsafe(16)
        actor = Actor(Person(key, name, identity.role), channel, None, Grounds.SAFETY)
        cause = pressed(name, key, press, time.time())
        who = identity.session if self._authenticator.requires_link else _address_of(client)
        stopped, executed = self._present(press)
        if stopped is not None and not self._takes(who):
            await asyncio.sleep(DELAY)
            stopped, executed = self._present(press)
            # If the stop was cleared meanwhile, this press counts.
            if stopped is not None:
                return _stop_reply(stopped)
        if stopped is None and executed:
            return _answer("cleared", "This press stopped the arm; that stop was cleared since.")
        # Sent even if the arm is stopped, so that late copies of this press are recognised.
        pipe.press(StopPress(cause, actor))
        if stopped is None:
            log.info("STOP arrived on its own port.")
            open_after = self._kept < MAX_KEPT
            self._kept += open_after
            try:
                with self._acceptor.kept(client) if open_after else nullcontext():
                    stopped = await pipe.executed(press, CONFIRM_TIMEOUT)
            finally:
                self._kept -= open_after
        return _stop_reply(stopped)

    def _present(self, press: str) -> tuple[StopCause | None, bool]:
        """Return the present stop, and whether the arm has executed ``press``.

        (None, False) while the arm's process does not answer.
        """
        status = self._pipe.status
        if status is None or self._pipe.age >= NO_STATE:
            return None, False
        return status.stopped, press in status.presses

    def _health(self) -> Reply:
        pipe = self._pipe
        if pipe.status is None:
            problem = "The arm is not ready yet."
        elif pipe.age >= NO_STATE:
            problem = f"No answer from the arm's process for {pipe.age:.1f} s."
        else:
            return Reply(HTTPStatus.OK, b"ok\n")
        return Reply(HTTPStatus.SERVICE_UNAVAILABLE, f"{problem}\n".encode())


def _stop_reply(stopped: StopCause | None) -> Reply:
    """Return the answer to a STOP: confirmed by a stop of the arm, or only requested."""
    return _answer("requested", "") if stopped is None else _answer("confirmed", stopped.why)


def _answer(stage: str, why: str) -> Reply:
    status = HTTPStatus.ACCEPTED if stage == "requested" else HTTPStatus.OK
    return Reply(
        status, json.dumps({"stop": stage, "why": why}).encode() + b"\n", "application/json"
    )


def _address_of(client: tuple[str, int] | None) -> str:
    return "" if client is None else client[0]


def _readable_by(origin: str | None, reply: Reply) -> Reply:
    """Return ``reply``, which the page of ``origin`` on the main port may read."""
    if origin is None:
        return reply
    more = (
        ("access-control-allow-origin", origin),
        ("access-control-allow-credentials", "true"),
        ("vary", "Origin"),
    )
    return reply._replace(headers=(*reply.headers, *more))


class StopConnection(asyncio.Protocol):
    """One connection, which is closed after the answer to its first request."""

    def __init__(self, server: StopServer) -> None:
        self._server = server
        self._http = h11.Connection(h11.SERVER, max_incomplete_event_size=MAX_HEAD_BYTES)
        self._task: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep ``transport`` for the answer."""
        self._transport = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        """Handle the request once it is whole."""
        if self._task is not None:
            return
        try:
            self._http.receive_data(data)
            event = self._http.next_event()
        except h11.RemoteProtocolError:
            refused = Reply(HTTPStatus.BAD_REQUEST, b"This is no valid HTTP request.")
            self._task = asyncio.create_task(self._refuse(refused))
            return
        if isinstance(event, h11.Request):
            self._task = asyncio.create_task(self._handle(event))

    def eof_received(self) -> bool:
        """Return whether an answer is still to come."""
        return self._task is not None

    @property
    def _client(self) -> tuple[str, int] | None:
        """Address and port of the sender; None once the connection is closed."""
        peer = self._transport.get_extra_info("peername")
        return None if peer is None else (peer[0], peer[1])

    async def _refuse(self, reply: Reply) -> None:
        self._send(await self._server.delayed(reply, self._client))
        self._transport.close()

    async def _handle(self, request: h11.Request) -> None:
        try:
            reply = await self._server.reply(request, self._client)
        except Exception:
            log.exception("A request on the port of STOP met an error.")
            reply = Reply(HTTPStatus.INTERNAL_SERVER_ERROR, b"See the log of the server.")
        self._send(reply)
        lengths = {text for name, text in request.headers if name == b"content-length"}
        if lengths <= {b"0"} and not any(
            name == b"transfer-encoding" for name, _ in request.headers
        ):
            self._transport.close()
        else:
            # Closed at once, the unread body would reset the connection before the answer is read.
            asyncio.get_running_loop().call_later(LINGER, self._transport.close)

    def _send(self, reply: Reply) -> None:
        # A STOP counts even if its sender is gone before the answer.
        if self._transport.is_closing():
            return
        length = ("content-length", str(len(reply.body)))
        headers = (*HEADERS, ("content-type", reply.media_type), length, *reply.headers)
        response = h11.Response(
            status_code=reply.status,
            reason=HTTPStatus(reply.status).phrase,
            headers=[(name, value) for name, value in headers],
        )
        for event in (response, h11.Data(data=reply.body), h11.EndOfMessage()):
            self._transport.write(self._http.send(event) or b"")
