"""Identity of each client, and the limits on its connections and requests.

Sits between the security headers and the application. A connection on which somebody known asks for
something is spared by the acceptor for as long; all others may be closed to make room.
"""

from __future__ import annotations

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

from katana450.server.api.fields import ROOT
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.connection_limit import ConnectionLimit

SOCKETS, SOCKETS_EACH = 256, 32
"""Websockets at a time, of all together and of one identity; a page has two, a program one."""

REQUESTS, REQUESTS_EACH = 128, 16
"""HTTP requests that are answered at a time."""

STOP_PATHS = ("/stop", f"{ROOT}/stop")
"""Always answered. They read no body, so they end at once."""

TOO_MANY = 429

LIMIT_CLOSE_CODE = 4429
"""Close code of a websocket whose client exceeds a limit."""

RETRY = {"Retry-After": "1"}


def identity(authenticator: Authenticator, asked: HTTPConnection) -> str | None:
    """Whose budget and places ``asked`` takes from: of a link or cookie, else of an address.

    None for a stranger where the server asks for a link.
    """
    found = authenticator.identity(asked.cookies)
    if found is None and authenticator.asks:
        found = authenticator.program("", asked.headers.get("authorization", ""))
    if found is not None:
        return found.session
    return None if authenticator.asks else address_of(asked)


def address_of(asked: HTTPConnection) -> str:
    """The address that ``asked`` comes from."""
    return "" if asked.client is None else asked.client.host


async def refuse(socket: WebSocket, why: str) -> None:
    """Close a websocket that was asked for, and say why.

    It is accepted first: browsers and our client show nobody the answer to a handshake that fails.
    """
    await socket.accept()
    await socket.close(LIMIT_CLOSE_CODE, why)


class Admission:
    """Middleware that refuses more than there are places for."""

    def __init__(self, app: ASGIApp, authenticator: Authenticator, acceptor: Acceptor) -> None:
        self._app = app
        self._authenticator = authenticator
        self._acceptor = acceptor
        self._requests = ConnectionLimit(REQUESTS, REQUESTS_EACH)
        self._sockets = ConnectionLimit(SOCKETS, SOCKETS_EACH)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        asked = HTTPConnection(scope)
        who = identity(self._authenticator, asked)
        socket = scope["type"] == "websocket"
        if who is None or (not socket and scope["path"] in STOP_PATHS):
            await self._app(scope, receive, send)
            return
        client = None if asked.client is None else (asked.client.host, asked.client.port)
        with (self._sockets if socket else self._requests).taken(who) as free:
            if free:
                with self._acceptor.kept(client):
                    await self._app(scope, receive, send)
            elif socket:
                why = "Too many connections of yours are open. Close some windows or programs."
                await refuse(WebSocket(scope, receive, send), why)
            else:
                why = "Too many requests of yours at once. Wait for their answers."
                await PlainTextResponse(why, TOO_MANY, RETRY)(scope, receive, send)
