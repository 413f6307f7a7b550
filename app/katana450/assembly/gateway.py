"""The gateway: a thread with the web server on the only port that other machines can reach."""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import socket
import threading
import time
from asyncio import BaseTransport, Transport
from collections.abc import Callable, Coroutine, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from http import HTTPStatus
from typing import Any, cast

import uvicorn
import viser
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Request

from katana450.arm.robot.object_meshes import Meshes
from katana450.assembly.authentication import access_file, address_of, tls_context
from katana450.assembly.memory_limit import check_memory_limit
from katana450.assembly.routes import application
from katana450.errors import ConfigurationError, LeaseError
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budgets
from katana450.server.service.heartbeats import Arrival, keep_alive
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.request_handler import RequestHandler
from katana450.server.service.runner import Runner
from katana450.server.service.stop_path import StopPath
from katana450.server.service.stop_state import ClearBy
from katana450.server.viser_bridge.gestures import Gestures
from katana450.server.viser_bridge.guard import Guard
from katana450.server.viser_bridge.message_filter import MAX_MESSAGE_BYTES
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.viser_bridge.viser_server import open_server
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import Authenticator, identity_of
from katana450.server.web.channel import ARRIVAL, PING
from katana450.server.web.http_api import RouteProvider
from katana450.server.web.listen import raise_descriptor_limit
from katana450.server.web.program_socket import LineServer
from katana450.server.web.security import FOR_PROGRAMS
from katana450.server.web.stop_monitor import watch_stop_path
from katana450.settings import Settings

log = logging.getLogger(__name__)

MAX_UNSENT_BYTES = 16_384
"""Bytes that may wait to be sent to a browser. Newer states do not replace waiting bytes."""

MAX_PROGRAM_MESSAGE_BYTES = 524_288
"""Maximum size of a message of a program. Each channel refuses less than that in words."""

READ_CHUNK_BYTES = 4_096
"""Bytes that are read at once from a browser. All clients wait while they are parsed."""

TLS_READ_CHUNK_BYTES = 65_536
"""Size of the receive buffer with TLS, which reads all that the system holds."""

REST_TICK = 0.1
"""[s] Interval of the checks while the arm rests and is not stopped; otherwise ``TICK``."""

START_SECONDS = 10.0
GOODBYE_SECONDS = 1

ANSWER_SECONDS = 2.0
"""[s] Timeout of a thread of the view for an answer of the server's thread."""


class Gateway:
    """The web server with its port, and viser behind it."""

    def __init__(
        self,
        settings: Settings,
        listening: socket.socket,
        lines: socket.socket | None = None,
        meshes: Meshes | None = None,
        routes: Sequence[RouteProvider] = (),
        runner: Callable[[Hub], Runner] | None = None,
        handlers: Sequence[Callable[[Hub], RequestHandler]] = (),
    ) -> None:
        """Set up the server; it does not answer yet.

        Args:
            settings: settings of the server.
            listening: the socket for browsers.
            lines: the socket for programs that send JSON lines.
            meshes: the meshes of scene objects, to which uploaded ones are added.
            routes: routes of the extensions.
            runner: see ``Hub``.
            handlers: further handlers of requests.

        Raises:
            ConfigurationError: ``settings`` do not allow serving on this socket.
        """
        tls_context(settings)
        raise_descriptor_limit()
        check_memory_limit()
        self._settings = settings
        self._listening = listening
        self._lines_socket = lines
        self._loop: asyncio.AbstractEventLoop | None = None
        try:
            access = access_file(settings, self._listening)
            key = secrets.token_urlsafe(32)
            self.viser: viser.ViserServer = open_server(key)
            self.port: int = self._listening.getsockname()[1]
            for each in (listening, lines):
                if each is not None:
                    keep_alive(each)
            self.address = address_of(settings, self._listening)
            self.hub = Hub(
                time.monotonic, settings.silence, meshes, runner, ClearBy(settings.clear_by)
            )
            for handler in handlers:
                self.hub.add_handler(handler(self.hub))
            self.hub.stop_path = StopPath(
                # Behind a proxy, the paths of STOP on the page's own address lead there.
                settings.stop_port if settings.public_url is None else None,
                self.port,
                self.address.secure,
            )
            people = self.hub.people
            people.links = access
            now = time.time()
            for number, grant in {} if access is None else access.grants.items():
                if now < grant.expires:
                    left = grant.kept_out - now
                    people.restore(identity_of(number, grant), grant.muted, left)
            authenticator = Authenticator(access, self.port, self.address, people)
            guard = Guard(self.viser)
            self.gestures = Gestures(self.viser, guard, self.hub)
            self._proxy = Proxy(self.hub, authenticator, guard, self.viser.get_port(), key)
            acceptor, budgets = Acceptor(listening), Budgets(self.hub.clock)
            app = application(
                self.hub, authenticator, budgets, self._proxy, self.address, acceptor, routes
            )
            self._lines = LineServer(self.hub, authenticator, budgets)
        except BaseException:
            self._listening.close()
            raise
        self._server = _Server(
            acceptor,
            uvicorn.Config(
                app,
                http="h11",
                ws=_BrowserSocket,
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
        self._thread = threading.Thread(target=self._run, name="gateway", daemon=True)
        self._started = threading.Event()
        self._moves = asyncio.Event()
        self._close_until = -math.inf

    def start(self) -> None:
        """Start answering. Raises ConfigurationError if the server does not start."""
        self._thread.start()
        if not self._started.wait(START_SECONDS) or not self._thread.is_alive():
            raise ConfigurationError("The gateway did not start; see the log above.")

    def attach(self, arm: ArmHandle) -> None:
        """Let clients drive ``arm`` from now on."""
        arm.listen(self.hub.recorder.outcomes)
        self.hub.gate.arm = arm

    def show(self) -> None:
        """Let browsers have the scene, which is complete."""
        self.soon(self._proxy.complete.set)

    def announce(self, why: str) -> None:
        """Notify all clients why a request is not executed. Can be called in any thread."""
        self.soon(self.hub.announce, why)

    def soon(self, act: Callable[..., None], *arguments: Any) -> None:
        """Run ``act`` in the server's thread, and return at once. Can be called in any thread."""
        # RuntimeError: the server has ended.
        if self._loop is not None:
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(act, *arguments)

    def call(self, act: Callable[[], None]) -> None:
        """Run ``act`` in the server's thread, and return afterwards. For any other thread.

        Raises the error of ``act``, and LeaseError if the server does not answer.
        """
        loop, future = self._loop, Future[None]()
        if loop is None:
            raise LeaseError("The server has not started yet.")

        def done() -> None:
            try:
                act()
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(None)

        loop.call_soon_threadsafe(done)
        try:
            future.result(ANSWER_SECONDS)
        except TimeoutError as error:
            raise LeaseError("The server does not answer. Check the state of the arm.") from error

    def stop(self) -> None:
        """Close every socket and the port; ``close_server`` closes viser."""
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join()
        self._listening.close()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        tasks = [asyncio.create_task(each) for each in self._watches()]
        try:
            async with self._lines.open(self._lines_socket):
                await self._server.serve()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._started.set()

    def _watches(self) -> Iterator[Coroutine[Any, Any, None]]:
        """Yield the watchdogs of this process."""
        yield self._watch()
        port, host = self._settings.stop_port, self._listening.getsockname()[0]
        if port is not None:
            secure = self._settings.tls_cert is not None
            yield watch_stop_path(self.hub.stop_path, host, port, self._arm_age, secure=secure)

    def _arm_age(self) -> float:
        """Return the time since the arm's process was heard [s]; infinite before."""
        return math.inf if self.hub.arm is None else self.hub.arm.age

    def watch_closely(self) -> None:
        """Check at the short interval for a while, because a command may move the arm."""
        self._close_until = self.hub.clock() + 2 * REST_TICK
        self._moves.set()

    async def _watch(self) -> None:
        pause = TICK
        while True:
            if self._server.started:
                self._started.set()
            hub = self.hub
            try:
                hub.tick(pause)
            except Exception:
                # The watchdog of the arm must survive every error.
                log.exception("The watchdog of the driver met an error.")
            rests = not (hub.stopped or hub.gate.moves() or hub.runner.running)
            rests = rests and hub.clock() > self._close_until
            pause = REST_TICK if rests else TICK
            if not rests:
                await asyncio.sleep(pause)
                continue
            self._moves.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(pause):
                    await self._moves.wait()


class _Server(uvicorn.Server):
    """A server for the connections that an acceptor admits.

    asyncio alone accepts thousands of connections in a turn, has no limits, and logs a traceback
    for each failure.
    """

    def __init__(self, acceptor: Acceptor, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._acceptor = acceptor

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:  # noqa: ARG002
        await super().startup(sockets=[])
        # The acceptor has the methods with which uvicorn closes its servers and waits for them.
        self.servers.append(cast(Any, self._acceptor.start(self._protocol, self.config.ssl)))

    def _protocol(self) -> asyncio.Protocol:
        protocol: asyncio.Protocol = cast(Any, self.config.http_protocol_class)(
            config=self.config, server_state=self.server_state, app_state=self.lifespan.state
        )
        return protocol


class _BrowserSocket(WebSocketsSansIOProtocol):
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
            self.arrival = Arrival(sock)
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
