"""The extension ``phone``: the address of the server for a phone, as a QR code in the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.server.web.http_api import RouteContext


def _routes(context: RouteContext) -> list[BaseRoute]:
    from katana450.extensions.phone.route import phone_route

    return [phone_route(context)]


EXTENSION = Extension("phone", serve=ServeExtension(routes=_routes))
