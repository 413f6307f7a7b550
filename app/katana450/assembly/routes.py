"""The routes: the page, its files, viser behind its message filter, and the API for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp

from katana450.arm.control.actor import CommandChannel
from katana450.assembly.page_routes import signed_in
from katana450.assembly.web_server import WebServer
from katana450.server.api.fields import MAX_PRESS_LENGTH
from katana450.server.service import status
from katana450.server.service.budget import Budgets
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE
from katana450.server.service.mutes import MutedError
from katana450.server.service.participants import actor_of
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.web import control_socket
from katana450.server.web.admission import Admission
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.bodies import TOO_MANY
from katana450.server.web.http_api import Api, RouteProvider


def application(
    hub: Hub,
    budgets: Budgets,
    proxy: Proxy,
    web: WebServer,
    provided: Sequence[RouteProvider] = (),
) -> ASGIApp:
    """Return the application with all routes of the port; ``provided``: those of the extensions."""
    authenticator = web.authenticator

    async def stop(request: Request) -> Response:
        """Stop the arm, like the button, for a page whose socket is closed."""
        identity = signed_in(authenticator, request, stopping=True)
        press = request.query_params.get("press", "")[:MAX_PRESS_LENGTH]
        actor = actor_of(identity, CommandChannel.PAGE)
        if PAGE.fullmatch(name := request.query_params.get("page", "")):
            actor = replace(actor, person=hub.person_of(identity, name))
        hub.stop(actor, press or None)
        return Response(status_code=204)

    routes = [
        *web.routes,
        Route("/stop", stop, methods=["POST"]),
        _leave_route(hub, authenticator),
        _health_route(hub),
        WebSocketRoute("/viser", proxy.serve),
        WebSocketRoute("/control", partial(control_socket.serve, hub, authenticator, budgets)),
        *Api(hub, authenticator, budgets, provided).routes(),
    ]
    app = Starlette(routes=routes, exception_handlers={MutedError: _muted})
    return Admission(app, hub, authenticator, web.acceptor)


async def _muted(_request: Request, error: Exception) -> Response:
    """Answer a STOP that does not count, because its sender is muted."""
    assert isinstance(error, MutedError)
    retry = {"Retry-After": str(math.ceil(error.retry))}
    return PlainTextResponse(str(error), TOO_MANY, retry)


def _health_route(hub: Hub) -> Route:
    async def health(_request: Request) -> Response:
        problem = status.health(hub)
        return PlainTextResponse(f"{problem or 'ok'}\n", 503 if problem else 200)

    return Route("/health", health)


def _leave_route(hub: Hub, authenticator: Authenticator) -> Route:
    async def leave(request: Request) -> Response:
        """Free the arm of a page whose window was closed."""
        identity = signed_in(authenticator, request)
        if PAGE.fullmatch(name := request.query_params.get("page", "")):
            hub.close(identity, name)
        return Response(status_code=204)

    return Route("/leave", leave, methods=["POST"])
