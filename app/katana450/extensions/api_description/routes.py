"""The route of the description."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.extensions.api_description.openapi import openapi_json
from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext


def description_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of the OpenAPI document, which everybody may read.

    It describes the paths and requests of this server, also those of its extensions.
    """
    hub = context.hub

    async def openapi(request: Request) -> Response:
        present = frozenset(getattr(route, "path", "") for route in request.app.routes)
        return Response(openapi_json(hub.requests.kinds, present), media_type="application/json")

    return [Route(f"{ROOT}/openapi.json", openapi)]
