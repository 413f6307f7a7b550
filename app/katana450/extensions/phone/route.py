"""The route of the address for a phone."""

from __future__ import annotations

import asyncio

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from katana450.extensions.phone.address import phone_address
from katana450.server.api.fields import ROOT
from katana450.server.web.bodies import TOO_MANY
from katana450.server.web.http_api import RouteContext
from katana450.server.web.limits import TokenBucket

CODES_PER_SECOND, CODES_BURST = 2.0, 10.0
"""QR codes that are drawn per second, and in a burst, for all pages together."""


def phone_routes(context: RouteContext) -> list[Route]:
    """Return the one route, which answers with the address of this server for a phone."""
    hub, authenticator = context.hub, context.authenticator
    codes = TokenBucket(CODES_PER_SECOND, CODES_BURST, hub.clock())

    async def phone(request: Request) -> Response:
        context.identity(request)
        if not codes.take(hub.clock()):
            raise HTTPException(TOO_MANY, "Too many requests. Wait a moment.")
        found = await asyncio.to_thread(
            phone_address,
            authenticator.address,
            request.headers["host"],
            hub.stop_path.main_port,
            requires_link=authenticator.requires_link,
        )
        return Response(msgspec.json.encode(found), media_type="application/json")

    return [Route(f"{ROOT}/phone", phone)]
