"""The gateway: the application behind the web server, with viser behind it."""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import socket
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

import viser

from katana450.arm.robot.object_meshes import Meshes
from katana450.assembly.routes import application
from katana450.assembly.web_server import WebServer
from katana450.errors import LeaseError
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budgets
from katana450.server.service.heartbeats import keep_alive
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.request_handler import RequestHandler
from katana450.server.service.runner import Runner
from katana450.server.service.stop_state import ClearBy
from katana450.server.viser_bridge.gestures import Gestures
from katana450.server.viser_bridge.guard import Guard
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.viser_bridge.viser_server import open_server
from katana450.server.web.http_api import RouteProvider
from katana450.server.web.program_socket import LineServer
from katana450.server.web.stop_monitor import watch_stop_path
from katana450.settings import Settings

log = logging.getLogger(__name__)

REST_TICK = 0.1
"""[s] Interval of the checks while the arm rests and is not stopped; otherwise ``TICK``."""

ANSWER_SECONDS = 2.0
"""[s] Timeout of a thread of the view for an answer of the server's thread."""


class Gateway:
    """All that browsers and programs can ask for, beyond the files of our page."""

    def __init__(
        self,
        settings: Settings,
        web: WebServer,
        lines: socket.socket | None = None,
        meshes: Meshes | None = None,
        routes: Sequence[RouteProvider] = (),
        runner: Callable[[Hub], Runner] | None = None,
        handlers: Sequence[Callable[[Hub], RequestHandler]] = (),
    ) -> None:
        """Set up the application; ``start`` gives it to the server.

        Args:
            settings: settings of the server.
            web: the web server, which is started.
            lines: the socket for programs that send JSON lines.
            meshes: the meshes of scene objects, to which uploaded ones are added.
            routes: routes of the extensions.
            runner: see ``Hub``.
            handlers: further handlers of requests.
        """
        self._settings, self._web = settings, web
        self._lines_socket = lines
        if lines is not None:
            keep_alive(lines)
        key = secrets.token_urlsafe(32)
        self.viser: viser.ViserServer = open_server(key)
        self.hub = Hub(time.monotonic, settings.silence, meshes, runner, ClearBy(settings.clear_by))
        self.hub.people, self.hub.stop_path = web.people, web.stop_path
        self.hub.gate.recorder = web.recorder
        for handler in handlers:
            self.hub.add_handler(handler(self.hub))
        guard = Guard(self.viser)
        self.gestures = Gestures(self.viser, guard, self.hub)
        self._proxy = Proxy(self.hub, web.authenticator, guard, self.viser.get_port(), key)
        budgets = Budgets(self.hub.clock)
        self._app = application(self.hub, budgets, self._proxy, web, routes)
        self._lines = LineServer(self.hub, web.authenticator, budgets)
        self._moves = asyncio.Event()
        self._close_until = -math.inf

    def start(self) -> None:
        """Let the server answer every request."""
        self.soon(self._web.complete, self._app, *self._watches())

    def attach(self, arm: ArmHandle) -> None:
        """Let clients drive ``arm`` from now on."""
        arm.listen(self.hub.recorder.outcomes)

        def attach() -> None:
            self.hub.gate.arm = arm
            # Before any request sees the arm.
            self.hub.follow_stop()

        self.soon(attach)

    def show(self) -> None:
        """Let browsers have the scene, which is complete."""
        self.soon(self._proxy.complete.set)

    def announce(self, why: str) -> None:
        """Notify all clients why a request is not executed. Can be called in any thread."""
        self.soon(self.hub.announce, why)

    def soon(self, act: Callable[..., None], *arguments: Any) -> None:
        """Run ``act`` in the server's thread, and return at once. Can be called in any thread."""
        # RuntimeError: the server has ended.
        with suppress(RuntimeError):
            self._web.loop.call_soon_threadsafe(act, *arguments)

    def call(self, act: Callable[[], None]) -> None:
        """Run ``act`` in the server's thread, and return afterwards. For any other thread.

        Raises the error of ``act``, and LeaseError if the server does not answer.
        """
        future = Future[None]()

        def done() -> None:
            try:
                act()
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(None)

        self._web.loop.call_soon_threadsafe(done)
        try:
            future.result(ANSWER_SECONDS)
        except TimeoutError as error:
            raise LeaseError("The server does not answer. Check the state of the arm.") from error

    def _watches(self) -> Iterator[Coroutine[Any, Any, None]]:
        """Yield the watchdogs of this process, and the server of JSON lines."""
        yield self._watch()
        yield self._lines.run(self._lines_socket)
        port, host = self._settings.stop_port, self._web.host
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
