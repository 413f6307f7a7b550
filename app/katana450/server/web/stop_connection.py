"""A connection to the port of STOP: one HTTP request, or two JSON lines."""

from __future__ import annotations

import asyncio
import logging
from http import HTTPStatus
from typing import cast

import h11

from katana450.server.web.stop_server import Reply, StopServer

log = logging.getLogger(__name__)

MAX_HEAD_BYTES = 8192
"""Maximum size of a request without its body, or of both lines [bytes]."""

LINGER = 0.5
"""[s] Time in which the body of an answered request is received, and dropped."""

HEADERS = (
    ("cache-control", "no-store"),
    ("connection", "close"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
)


class StopConnection(asyncio.Protocol):
    """One connection, which is closed after the answer to its first request."""

    def __init__(self, server: StopServer) -> None:
        self._server = server
        self._http = h11.Connection(h11.SERVER, max_incomplete_event_size=MAX_HEAD_BYTES)
        self._lines = bytearray()
        self._task: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep ``transport`` for the answer."""
        self._transport = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        """Handle the request once it is whole."""
        if self._task is not None:
            return
        if self._lines or (self._http.their_state is h11.IDLE and data.startswith(b"{")):
            self._receive_lines(data)
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
        """Count a last line without its line feed; return whether an answer is still to come."""
        if self._lines and self._task is None:
            self._receive_lines(b"\n")
        return self._task is not None

    def _receive_lines(self, data: bytes) -> None:
        """Receive JSON lines; no request of a browser begins with a brace."""
        self._lines += data
        lines = bytes(self._lines).split(b"\n", 2)
        if len(lines) > 2 or len(self._lines) > MAX_HEAD_BYTES:
            self._task = asyncio.create_task(self._handle_lines(lines))

    async def _handle_lines(self, lines: list[bytes]) -> None:
        try:
            body = (await self._server.reply_to_lines(lines, self._client)).body
        except Exception:
            log.exception("Two lines on the port of STOP met an error.")
            body = b'{"stop": "refused", "why": "See the log of the server."}\n'
        if not self._transport.is_closing():
            self._transport.write(body)
        self._transport.close()

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
