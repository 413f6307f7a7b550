"""The routes that need the arm, beside those of the API: of our page, and for monitors."""

from __future__ import annotations

from dataclasses import replace

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.arm.control.actor import CommandChannel
from katana450.assembly.page_routes import signed_in
from katana450.assembly.web_server import WebServer
from katana450.server.api.fields import MAX_PRESS_LENGTH
from katana450.server.service import status
from katana450.server.service.budget import Budgets
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE
from katana450.server.service.participants import actor_of
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.web import control_socket


def control_routes(hub: Hub, budgets: Budgets, web: WebServer, proxy: Proxy) -> list[BaseRoute]:
    """Return the routes."""
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
        await control_socket.serve(hub, authenticator, budgets, socket)

    return [
        Route("/stop", stop, methods=["POST"]),
        Route("/leave", leave, methods=["POST"]),
        Route("/health", health),
        WebSocketRoute("/viser", proxy.serve),
        WebSocketRoute("/control", control),
    ]
