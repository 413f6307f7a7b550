"""Identity of each client, and the limits on its connections and requests.

This middleware runs between the security headers and the application. While a known client has a
request on a connection, the acceptor keeps it open. All others may be closed to make room.
"""

from __future__ import annotations

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

from katana450.server.api.fields import STOP_PATHS
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.connection_limit import ConnectionLimit

SOCKETS, SOCKETS_EACH = 256, 32
"""Maximum of open websockets, in total and of one identity. A page has two, a program one."""

REQUESTS, REQUESTS_EACH = 128, 16
"""Maximum of concurrent HTTP requests, in total and of one identity."""

TOO_MANY = 429

LIMIT_CLOSE_CODE = 4429
"""Close code of a websocket whose client exceeds a limit."""

RETRY = {"Retry-After": "1"}


def identity(authenticator: Authenticator, connection: HTTPConnection) -> str | None:
    """Return the link, cookie or address to whose limits ``connection`` counts.

    Return None for an unknown client where the server requires a link.
    """
    found = authenticator.identity(connection.cookies)
    if found is None and authenticator.requires_link:
        found = authenticator.program("", connection.headers.get("authorization", ""))
    if found is not None:
        return found.session
    return None if authenticator.requires_link else address_of(connection)


def address_of(connection: HTTPConnection) -> str:
    """Return the host address of the client of ``connection``."""
    return "" if connection.client is None else connection.client.host


async def refuse(socket: WebSocket, why: str) -> None:
    """Close a requested websocket with the reason ``why``.

    The websocket is accepted first: browsers and our client do not show the answer to a handshake
    that fails.
    """
    await socket.accept()
    await socket.close(LIMIT_CLOSE_CODE, why)


class Admission:
    """Middleware that limits concurrent requests and websockets."""

    def __init__(self, app: ASGIApp, authenticator: Authenticator, acceptor: Acceptor) -> None:
        self._app = app
        self._authenticator = authenticator
        self._acceptor = acceptor
        self._requests = ConnectionLimit(REQUESTS, REQUESTS_EACH)
        self._sockets = ConnectionLimit(SOCKETS, SOCKETS_EACH)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it if a limit is reached."""
        connection = HTTPConnection(scope)
        who = identity(self._authenticator, connection)
        socket = scope["type"] == "websocket"
        if who is None or (not socket and scope["path"] in STOP_PATHS):
            await self._app(scope, receive, send)
            return
        peer = connection.client
        client = None if peer is None else (peer.host, peer.port)
        with (self._sockets if socket else self._requests).taken(who) as free:
            if free:
                with self._acceptor.kept(client):
                    await self._app(scope, receive, send)
            elif socket:
                why = "You have too many open connections. Close some windows or programs."
                await refuse(WebSocket(scope, receive, send), why)
            else:
                why = "You sent too many requests at once. Wait for their answers."
                await PlainTextResponse(why, TOO_MANY, RETRY)(scope, receive, send)
