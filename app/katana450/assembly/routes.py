"""The routes: the page, its files, viser behind its message filter, and the API for programs."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import msgspec
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from katana450.arm.control.actor import CommandChannel
from katana450.server.api.fields import MAX_PRESS_LENGTH
from katana450.server.service import status
from katana450.server.service.budget import Budgets
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE, Identity
from katana450.server.service.mutes import MutedError
from katana450.server.service.participants import actor_of
from katana450.server.service.recorder import ACCEPTED, REFUSED, stranger
from katana450.server.viser_bridge import viser_page
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.web import control_socket, security, static_files
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.admission import Admission, address_of
from katana450.server.web.authenticator import Address, Authenticator
from katana450.server.web.bodies import TOO_MANY, body_of
from katana450.server.web.http_api import Api, RouteProvider
from katana450.server.web.token_bucket import TokenBucket

log = logging.getLogger(__name__)

MAX_BODY_BYTES = 1024
"""Maximum size of the body of a POST request [bytes]."""

BAD_LINKS_PER_SECOND, BAD_LINKS_BURST = 2.0, 20.0
"""Invalid links that are answered per second, and in a burst, for all clients together."""

STOP_PORT = "X-Stop-Port"
"""Header that names the port to which the page also sends STOP."""


class _Entry(msgspec.Struct, forbid_unknown_fields=True):
    token: str


def application(
    hub: Hub,
    authenticator: Authenticator,
    budgets: Budgets,
    proxy: Proxy,
    address: Address,
    acceptor: Acceptor,
    provided: Sequence[RouteProvider] = (),
) -> ASGIApp:
    """Return the application with all routes of the port; ``provided``: those of the extensions."""
    static = static_files.load()
    index = static.pop("index.html")
    page_policy = security.page_policy()
    bad_links = TokenBucket(BAD_LINKS_PER_SECOND, BAD_LINKS_BURST, hub.clock())

    async def page(request: Request) -> Response:
        origin = hub.stop_path.origin_beside(request.headers["host"])
        return security.with_serial(index.answer(request, security.page_policy(origin)))

    async def file(request: Request) -> Response:
        found = static.get(request.path_params["name"])
        if found is None:
            raise HTTPException(404)
        # A web worker has the policy of its own file.
        return found.answer(request, page_policy)

    async def enter(request: Request) -> Response:
        """Sign in, with the token of an access link if the server requires one."""
        try:
            entry = msgspec.json.decode(await body_of(request, MAX_BODY_BYTES), type=_Entry)
        except msgspec.MsgspecError as error:
            raise HTTPException(400, "A token is required.") from error
        response = Response(status_code=204)
        if hub.stop_path.origin_beside(request.headers["host"]) is not None:
            response.headers[STOP_PORT] = str(hub.stop_path.port)
        if not entry.token and authenticator.identity(request.cookies) is not None:
            return response
        _check_admitted(authenticator, request, entry.token)
        found = authenticator.sign_in(entry.token, response)
        _note_sign_in(hub, request, found)
        if found is None:
            # A valid link is accepted even while others guess.
            if entry.token and not bad_links.take(hub.clock()):
                raise HTTPException(429, "Too many attempts. Wait a moment.")
            log.warning("A client used a link that is invalid or has expired.")
            raise HTTPException(401, "This link is invalid or has expired. Ask for another.")
        return response

    async def stop(request: Request) -> Response:
        """Stop the arm, like the button, for a page whose socket is closed."""
        identity = _signed_in(authenticator, request, stopping=True)
        press = request.query_params.get("press", "")[:MAX_PRESS_LENGTH]
        actor = actor_of(identity, CommandChannel.PAGE)
        if PAGE.fullmatch(name := request.query_params.get("page", "")):
            actor = replace(actor, person=hub.person_of(identity, name))
        hub.stop(actor, press or None)
        return Response(status_code=204)

    routes = [
        Route("/", page),
        Route("/static/{name:path}", file),
        *_viser_routes(authenticator, address),
        Route("/enter", enter, methods=["POST"]),
        Route("/stop", stop, methods=["POST"]),
        _leave_route(hub, authenticator),
        _health_route(hub),
        WebSocketRoute("/viser", proxy.serve),
        _control_route(hub, authenticator, budgets),
        *Api(hub, authenticator, budgets, provided).routes(),
    ]
    app = Starlette(routes=routes, exception_handlers={MutedError: _muted})
    admission = Admission(app, hub, authenticator, acceptor)
    return security.SecurityMiddleware(admission, address)


async def _muted(_request: Request, error: Exception) -> Response:
    """Answer a STOP that does not count, because its sender is muted."""
    assert isinstance(error, MutedError)
    retry = {"Retry-After": str(math.ceil(error.retry))}
    return PlainTextResponse(str(error), TOO_MANY, retry)


def _viser_routes(authenticator: Authenticator, address: Address) -> list[Route]:
    viser, policy = viser_page.load(), viser_page.policy()

    async def page(request: Request) -> Response:
        _signed_in(authenticator, request)
        scheme = "wss" if address.cookies_are_secure else "ws"
        origin = f"{scheme}://{request.headers['host']}"
        why = viser_page.objection(request.query_params, origin)
        if why is not None:
            raise HTTPException(400, why)
        return viser.html.answer(request, policy)

    async def file(request: Request) -> Response:
        found = viser.files.get(request.path_params["name"])
        if found is None:
            raise HTTPException(404)
        return found.answer(request)

    return [Route("/viser/", page), Route("/viser/{name}", file)]


def _control_route(hub: Hub, authenticator: Authenticator, budgets: Budgets) -> WebSocketRoute:
    async def control(socket: WebSocket) -> None:
        await control_socket.serve(hub, authenticator, budgets, socket)

    return WebSocketRoute("/control", control)


def _health_route(hub: Hub) -> Route:
    async def health(_request: Request) -> Response:
        problem = status.health(hub)
        return PlainTextResponse(
            "ok\n" if problem is None else f"{problem}\n", 503 if problem else 200
        )

    return Route("/health", health)


def _leave_route(hub: Hub, authenticator: Authenticator) -> Route:
    async def leave(request: Request) -> Response:
        """Free the arm of a page whose window was closed."""
        identity = _signed_in(authenticator, request)
        if PAGE.fullmatch(name := request.query_params.get("page", "")):
            hub.close(identity, name)
        return Response(status_code=204)

    return Route("/leave", leave, methods=["POST"])


def _check_admitted(authenticator: Authenticator, request: Request, token: str) -> None:
    """Raise HTTPException if an admin keeps out the bearer of ``token`` or of the cookie."""
    why = authenticator.refusal(request.cookies, f"Bearer {token}" if token else "")
    if why is not None:
        raise HTTPException(403, why)


def _note_sign_in(hub: Hub, request: Request, found: Identity | None) -> None:
    address = address_of(request)
    if found is None:
        why = "The link is invalid or has expired."
        hub.recorder.note("sign-in", stranger(address), outcome=REFUSED, why=why)
    else:
        actor = actor_of(replace(found, address=address), CommandChannel.PAGE)
        hub.recorder.note("sign-in", actor, outcome=ACCEPTED)


def _signed_in(
    authenticator: Authenticator, request: Request, *, stopping: bool = False
) -> Identity:
    identity = authenticator.identity(request.cookies, stopping=stopping)
    if identity is None:
        raise HTTPException(401, "Sign in at the start page first.")
    return replace(identity, address=address_of(request))
