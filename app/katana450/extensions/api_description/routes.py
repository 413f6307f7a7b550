"""The routes of the descriptions."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.extensions.api_description.asyncapi import asyncapi_json
from katana450.extensions.api_description.openapi import openapi_json
from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext


def description_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes of the OpenAPI and the AsyncAPI document, which everybody may read.

    They describe the paths and requests of this server, also those of its extensions.
    """
    hub = context.hub
    secure = context.authenticator.address.secure

    async def openapi(request: Request) -> Response:
        present = frozenset(getattr(route, "path", "") for route in request.app.routes)
        return Response(openapi_json(hub.requests.kinds, present), media_type="application/json")

    async def asyncapi(request: Request) -> Response:
        host = request.headers["host"]
        document = asyncapi_json(hub.requests.kinds, host, secure=secure)
        return Response(document, media_type="application/json")

    return [Route(f"{ROOT}/openapi.json", openapi), Route(f"{ROOT}/asyncapi.json", asyncapi)]
