"""Identity of each client, and the limits on its connections and requests.

This middleware runs between the security headers and the application. While a known client has a
request on a connection, the acceptor keeps it open. All others may be closed to make room.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

from katana450.arm.control.lease import CommandChannel, Role
from katana450.errors import InputError
from katana450.server.api.fields import STOP_PATHS
from katana450.server.service.identity import Identity
from katana450.server.service.limits import ConnectionLimit
from katana450.server.service.participants import actor_of
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.bodies import TOO_MANY, refusal
from katana450.server.web.security import FOR_PROGRAMS

if TYPE_CHECKING:
    from katana450.server.service.hub import Hub

SOCKETS, SOCKETS_EACH, RESERVED_SOCKETS = 256, 32, 6
"""Maximum of open websockets, in total and of one identity, and number reserved for the driver and
for each admin. A page has two, a program one."""

REQUESTS, REQUESTS_EACH, RESERVED_REQUESTS = 128, 16, 8
"""Maximum of concurrent HTTP requests, in total and of one identity, and number reserved for the
driver and for each admin."""

TOO_MANY_SOCKETS = "You have too many open connections. Close some windows or programs."
TOO_MANY_REQUESTS = "You sent too many requests at once. Wait for their answers."

LIMIT_CLOSE_CODE = 4429
"""Close code of a websocket whose client exceeds a limit."""

RETRY = {"Retry-After": "1"}


def client_of(authenticator: Authenticator, connection: HTTPConnection) -> Identity | None:
    """Return the identity to whose limits ``connection`` counts: a link, a cookie or an address.

    Return None for an unknown client where the server requires a link.
    """
    visitor = authenticator.identity(connection.cookies)
    if visitor is not None:
        return visitor
    if authenticator.requires_link:
        return authenticator.program("", authorization_of(connection))
    return Identity(address_of(connection), None, Role.ADMIN)


def authorization_of(connection: HTTPConnection) -> str:
    """Return the Authorization header, or one with the ``token`` in the address of a websocket.

    A page cannot add headers to a websocket.
    """
    token = connection.query_params.get("token", "") if connection["type"] == "websocket" else ""
    return connection.headers.get("authorization", "") or (f"Bearer {token}" if token else "")


def reserved(hub: Hub, authenticator: Authenticator, client: Identity, places: int) -> int:
    """Return ``places`` for the driver and for an admin with a link, else 0.

    Without links everybody is an admin, so only the driver has places reserved.
    """
    admin = authenticator.requires_link and client.role is Role.ADMIN
    return places if admin or client.session in hub.drivers else 0


def channel_of(scope: Scope) -> CommandChannel:
    """Return the channel of the commands that come on the connection of ``scope``."""
    if scope["type"] != "websocket":
        return CommandChannel.HTTP
    program = scope["path"].startswith(FOR_PROGRAMS)
    return CommandChannel.WEBSOCKET if program else CommandChannel.PAGE


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

    def __init__(
        self, app: ASGIApp, hub: Hub, authenticator: Authenticator, acceptor: Acceptor
    ) -> None:
        self._app = app
        self._hub = hub
        self._authenticator = authenticator
        self._acceptor = acceptor
        self._requests = ConnectionLimit(REQUESTS, REQUESTS_EACH)
        self._sockets = ConnectionLimit(SOCKETS, SOCKETS_EACH)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it if a limit is reached."""
        connection = HTTPConnection(scope)
        who = client_of(self._authenticator, connection)
        socket = scope["type"] == "websocket"
        if who is None or (not socket and scope["path"] in STOP_PATHS):
            await self._app(scope, receive, send)
            return
        peer = connection.client
        client = None if peer is None else (peer.host, peer.port)
        limit, places = self._requests, RESERVED_REQUESTS
        if socket:
            limit, places = self._sockets, RESERVED_SOCKETS
        places = reserved(self._hub, self._authenticator, who, places)
        with limit.taken(who.session, places) as free:
            if free:
                with self._acceptor.kept(client):
                    await self._app(scope, receive, send)
                return
            error = TOO_MANY_SOCKETS if socket else TOO_MANY_REQUESTS
            what = "connection" if socket else "request"
            actor = actor_of(who, channel_of(scope), address_of(connection))
            self._hub.recorder.refuse(what, actor, InputError(error))
            if socket:
                await refuse(WebSocket(scope, receive, send), error)
            else:
                await refusal(scope["path"], error, TOO_MANY, RETRY)(scope, receive, send)
