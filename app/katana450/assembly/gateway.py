"""The gateway: the application behind the web server, with viser behind it.

Parts that only requests need are imported after the scene is sent.
"""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import socket
import time
from argparse import Namespace
from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import viser
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.arm.control.lease import CommandChannel
from katana450.arm.robot.object_meshes import Meshes
from katana450.assembly.page_routes import signed_in
from katana450.assembly.web_server import WebServer
from katana450.errors import KatanaError
from katana450.extension import load, provided, results
from katana450.server.api.fields import MAX_PRESS_LENGTH
from katana450.server.service import status
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budgets
from katana450.server.service.heartbeats import keep_alive
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.identity import PAGE
from katana450.server.service.participants import actor_of
from katana450.server.service.stop_path import watch_stop_path
from katana450.server.viser_bridge.gestures import Gestures
from katana450.server.viser_bridge.guard import Guard
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.viser_bridge.viser_server import open_server
from katana450.server.web.admission import Admission
from katana450.server.web.bodies import refusal, status_of
from katana450.server.web.channel import serve_page
from katana450.settings import Settings

log = logging.getLogger(__name__)

REST_TICK = 0.2
"""[s] Interval of the checks while the arm rests and is not stopped; otherwise ``TICK``."""

RUNNER = "katana450.extensions.programs.server.program_runner:ProgramRunner"
"""Class that drives the arm by scripts."""


class Gateway:
    """All that browsers and programs can ask for, beyond the files of our page."""

    def __init__(
        self,
        settings: Settings,
        web: WebServer,
        lines: socket.socket | None = None,
        meshes: Meshes | None = None,
    ) -> None:
        """Set up the application; ``show`` and ``start`` give it to the server.

        Args:
            settings: settings of the server.
            web: the web server, which is started.
            lines: the socket for programs that send JSON lines.
            meshes: the meshes of scene objects, to which uploaded ones are added.
        """
        self._settings, self._web = settings, web
        self._lines_socket = lines
        if lines is not None:
            keep_alive(lines)
        key = secrets.token_urlsafe(32)
        self.viser: viser.ViserServer = open_server(key)
        self.hub = Hub(time.monotonic, settings.silence, meshes)
        self.hub.gate.sample_delay = settings.sample_delay
        self.hub.stop_path = web.stop_path
        self.hub.requires_link = web.authenticator.requires_link
        self.hub.gate.recorder = web.recorder
        guard = Guard(self.viser)
        self.gestures = Gestures(self.viser, guard, self.hub)
        proxy = Proxy(self.hub, web.authenticator, guard, self.viser.get_port(), key)
        self._budgets = Budgets(self.hub.clock)
        own = control_routes(self.hub, self._budgets, web, proxy)
        self._app = Starlette(routes=[*web.routes, *own], exception_handlers=REFUSALS)
        self._moves = asyncio.Event()
        self._close_until = -math.inf

    def show(self) -> None:
        """Let browsers have the scene, which is complete."""
        web = self._web
        self.soon(web.show, Admission(self._app, self.hub, web.authenticator, web.acceptor))

    def start(self, options: Namespace) -> None:
        """Let the server answer every request, also those of the extensions.

        ``options``: options of ``katana450 serve``.
        """
        from katana450.server.web.http_api import Api
        from katana450.server.web.program_socket import LineServer

        hub, authenticator = self.hub, self._web.authenticator
        hub.use_runner(load(RUNNER)(hub, options))
        for handler in results("handler", hub, options):
            hub.add_handler(handler)
        api = Api(hub, authenticator, self._budgets, options, list(provided("routes")))
        self._app.router.routes.extend(api.routes())
        lines = LineServer(hub, authenticator, self._budgets).run(self._lines_socket)
        self.soon(self._web.complete, lines, *self._watches())

    def attach(self, arm: ArmHandle) -> None:
        """Let clients drive ``arm`` from now on."""

        def attach() -> None:
            self.hub.gate.arm = arm
            self.hub.shown = {**self.hub.shown, "cautions": " ".join(arm.robot.cautions)}
            # Before any request sees the arm.
            self.hub.follow_stop()

        self.soon(attach)

    def soon(self, act: Callable[..., None], *arguments: Any) -> None:
        """Run ``act`` in the server's thread, and return at once. Can be called in any thread."""
        # RuntimeError: the server has ended.
        with suppress(RuntimeError):
            self._web.loop.call_soon_threadsafe(act, *arguments)

    def _watches(self) -> Iterator[Coroutine[Any, Any, None]]:
        """Yield the watchdogs of this process."""
        yield self._watch()
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
        # The time before counts for no delay of this machine.
        pause = self.hub.held_up
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


async def _refused(request: Request, error: Exception) -> Response:
    """Answer a request that is refused with an HTTP status."""
    if isinstance(error, HTTPException):
        return refusal(request.url.path, error.detail, error.status_code, error.headers)
    return refusal(request.url.path, str(error), status_of(error))


REFUSALS = dict.fromkeys((HTTPException, KatanaError), _refused)


def control_routes(hub: Hub, budgets: Budgets, web: WebServer, proxy: Proxy) -> list[BaseRoute]:
    """Return the routes."""
    authenticator = web.authenticator

    async def stop(request: Request) -> Response:
        """Stop the arm, like the button, for a page whose socket is closed."""
        identity = signed_in(authenticator, request)
        press = request.query_params.get("press", "")[:MAX_PRESS_LENGTH]
        actor = actor_of(identity, CommandChannel.PAGE)
        if PAGE.fullmatch(name := request.query_params.get("page", "")):
            actor = replace(actor, person=hub.person_of(identity, name))
        hub.stop(actor, press or None)
        return Response(status_code=204)

    async def leave(request: Request) -> Response:
        """Free the arm of a page whose window was closed."""
        identity = signed_in(authenticator, request)
        if PAGE.fullmatch(name := request.query_params.get("page", "")):
            hub.close(identity, name)
        return Response(status_code=204)

    async def health(_request: Request) -> Response:
        problem = status.health(hub)
        return PlainTextResponse(f"{problem or 'ok'}\n", 503 if problem else 200)

    async def control(socket: WebSocket) -> None:
        # A browser opens one websocket after the other: the scene waits until this one is accepted.
        await socket.accept()
        await web.ready.wait()
        await serve_page(hub, authenticator, budgets, socket)

    return [
        Route("/stop", stop, methods=["POST"]),
        Route("/leave", leave, methods=["POST"]),
        Route("/health", health),
        WebSocketRoute("/viser", proxy.serve),
        WebSocketRoute("/control", control),
    ]
