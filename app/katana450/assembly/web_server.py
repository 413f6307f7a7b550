"""The web server: a thread with the only port that other machines can reach.

It serves the pages at once, and the scene as soon as it is complete: a page that gets it in parts
draws every part. Other requests wait until the application is complete. Its imports take longer
than a browser needs for the pages.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from asyncio import BaseTransport, Transport
from collections.abc import Coroutine
from http import HTTPStatus
from typing import Any, cast

import uvicorn
from starlette.applications import Starlette
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Request

from katana450.assembly.authentication import access_file, address_of, tls_context
from katana450.assembly.page_routes import page_routes
from katana450.errors import ConfigurationError
from katana450.server.service.heartbeats import ARRIVAL, PING, LastHeartbeat, keep_alive
from katana450.server.service.recorder import Recorder
from katana450.server.service.stop_path import StopPath
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.listen import raise_descriptor_limit
from katana450.server.web.security import FOR_PROGRAMS, MAX_MESSAGE_BYTES, SecurityMiddleware
from katana450.settings import Settings

PAGES, FILES = ("/", "/enter"), ("/static/", "/viser/")
"""Paths, and prefixes of paths, that are served before the application is complete."""

SOCKETS = ("/viser", "/control")
"""Paths of the websockets of our page, which are opened when the scene is complete."""

GOODBYE_SECONDS = 1

MAX_UNSENT_BYTES = 16_384
"""Bytes that may wait to be sent to a browser. Newer states do not replace waiting bytes."""

MAX_PROGRAM_MESSAGE_BYTES = 524_288
"""Maximum size of a message of a program. Each channel refuses less than that in words."""

READ_CHUNK_BYTES = 4_096
"""Bytes that are read at once from a browser. All clients wait while they are parsed."""

TLS_READ_CHUNK_BYTES = 65_536
"""Size of the receive buffer with TLS, which reads all that the system holds."""


class WebServer:
    """The server, in a thread.

    Attributes:
        address: Names and addresses of the server.
        recorder: Notes events.
        authenticator: Identifies clients.
        stop_path: Second path of STOP.
        host: Address of the socket.
        acceptor: Admits the connections.
        routes: Routes that need no arm.
        loop: The event loop, once the server is started.
        ready: Set when every request is served.
    """

    loop: asyncio.AbstractEventLoop

    def __init__(self, settings: Settings, listening: socket.socket) -> None:
        """Set up the server on the socket ``listening``; it does not answer yet.

        Raises ConfigurationError if ``settings`` do not allow serving on this socket.
        """
        tls_context(settings)
        raise_descriptor_limit()
        access = access_file(settings, listening)
        self.address = address_of(settings, listening)
        # Behind a proxy, the paths of STOP on the page's own address lead there.
        port = settings.stop_port if settings.public_url is None else None
        self.stop_path = StopPath(port, listening.getsockname()[1], self.address.secure)
        self.host: str = listening.getsockname()[0]
        self.acceptor = Acceptor(listening)
        keep_alive(listening)
        self.recorder = Recorder()
        # Until the event log takes its notes, they wait.
        self.recorder.enabled = True
        port = self.stop_path.main_port
        self.authenticator = Authenticator(access, port, self.address)
        self.routes = page_routes(self.authenticator, self.stop_path, self.recorder)
        self._app: ASGIApp = Starlette(routes=self.routes)
        self._beside: list[asyncio.Task[None]] = []
        self._shown, self.ready = asyncio.Event(), asyncio.Event()
        self._server = _Server(
            self.acceptor,
            uvicorn.Config(
                SecurityMiddleware(self._answer, self.address),
                http="h11",
                ws=BrowserSocket,
                ws_max_size=MAX_MESSAGE_BYTES,
                ws_per_message_deflate=False,
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                timeout_graceful_shutdown=GOODBYE_SECONDS,
                ssl_certfile=settings.tls_cert,
                ssl_keyfile=settings.tls_key,
            ),
        )
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve()), name="gateway", daemon=True
        )

    def start(self) -> None:
        """Start answering. Raises ConfigurationError if the server does not start."""
        self._thread.start()
        self._server.begun.wait()
        if not self._thread.is_alive():
            raise ConfigurationError("The gateway did not start; see the log above.")

    def show(self, app: ASGIApp) -> None:
        """Serve the pages and the scene by ``app``. Call it in the server's thread."""
        self._app = app
        self._shown.set()

    def complete(self, *work: Coroutine[Any, Any, None]) -> None:
        """Serve all by that app, and run ``work`` as long. Call it in the server's thread."""
        self._beside = [asyncio.create_task(coroutine) for coroutine in work]
        self.ready.set()

    def stop(self) -> None:
        """Close every connection and stop answering."""
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join()

    async def _serve(self) -> None:
        self.loop = asyncio.get_running_loop()
        try:
            await self._server.serve()
        finally:
            self._server.begun.set()
            for task in self._beside:
                task.cancel()
            await asyncio.gather(*self._beside, return_exceptions=True)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        if not (scope["path"] in PAGES or scope["path"].startswith(FILES)):
            await (self._shown if scope["path"] in SOCKETS else self.ready).wait()
        await self._app(scope, receive, send)


class _Server(uvicorn.Server):
    """A server for the connections that an acceptor admits.

    asyncio alone accepts thousands of connections in a turn, has no limits, and logs a traceback
    for each failure.
    """

    def __init__(self, acceptor: Acceptor, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._acceptor, self.begun = acceptor, threading.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:  # noqa: ARG002
        await super().startup(sockets=[])
        # The acceptor has the methods with which uvicorn closes its servers and waits for them.
        self.servers.append(cast(Any, self._acceptor.start(self._protocol, self.config.ssl)))
        self.begun.set()

    async def main_loop(self) -> None:
        """Check a few times a second whether the server ends; uvicorn does it ten times."""
        while not await self.on_tick(0):
            await asyncio.sleep(0.25)

    def _protocol(self) -> asyncio.Protocol:
        protocol: asyncio.Protocol = cast(Any, self.config.http_protocol_class)(
            config=self.config, server_state=self.server_state, app_state=self.lifespan.state
        )
        return protocol


class BrowserSocket(WebSocketsSansIOProtocol):
    """A websocket with small buffers for sent and received bytes."""

    def connection_made(self, transport: BaseTransport) -> None:
        """Bound the buffers of the new connection."""
        super().connection_made(transport)
        cast(Transport, transport).set_write_buffer_limits(high=MAX_UNSENT_BYTES)
        sock = transport.get_extra_info("socket")
        if sock is None:
            return
        if hasattr(transport, "max_size"):
            # A smaller receive buffer of the system is no alternative: it drops packets that do not
            # fit, with the acknowledgements in them, and both ends stall.
            cast(Any, transport).max_size = READ_CHUNK_BYTES
        else:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, TLS_READ_CHUNK_BYTES)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT_BYTES)

    def handle_connect(self, event: Request) -> None:
        """Accept the websocket, and let the application see when messages arrive."""
        super().handle_connect(event)
        if self.response.status_code == HTTPStatus.SWITCHING_PROTOCOLS:
            # The socket knows when its newest message arrived.
            sock = self.transport.get_extra_info("socket")
            self.arrival = LastHeartbeat(line=sock)
            cast(dict[str, Any], self.scope).update({ARRIVAL: self.arrival, PING: self.ping})
            if self.scope["path"].startswith(FOR_PROGRAMS):
                self.conn.max_message_size = MAX_PROGRAM_MESSAGE_BYTES

    def ping(self) -> None:
        """Ask the client for an answer; nothing happens while the websocket opens or closes."""
        if self.handshake_complete and not (self.close_sent or self.transport.is_closing()):
            self.conn.send_ping(b"")
            self.transport.write(b"".join(self.conn.data_to_send()))

    def handle_pong(self, event: Frame) -> None:
        """Count the answer to ``ping`` as a heartbeat; those to other pings have content."""
        super().handle_pong(event)
        if not event.data:
            self.arrival.note()
