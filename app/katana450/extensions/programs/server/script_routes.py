"""Scripts of the library over HTTP, for pages that run them."""

from __future__ import annotations

import asyncio

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import BaseRoute, Route

from katana450.errors import InputError
from katana450.extensions.programs.script_files import Scripts
from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of the scripts of the library, by name."""
    scripts = Scripts()

    async def read(request: Request) -> Response:
        context.identity(request)
        try:
            text = await asyncio.to_thread(scripts.text, request.path_params["name"])
        except InputError as error:
            return PlainTextResponse(str(error), status_code=404)
        return PlainTextResponse(text)

    return [Route(f"{ROOT}/scripts/{{name}}", read)]
