"""The extension ``api_description``: documents from which other programs generate clients."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.server.web.http_api import RouteContext


def _routes(context: RouteContext) -> list[BaseRoute]:
    from katana450.extensions.api_description.routes import description_routes

    return description_routes(context)


EXTENSION = Extension("api_description", serve=ServeExtension(routes=_routes))
