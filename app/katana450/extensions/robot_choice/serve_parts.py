"""The routes of the choice of a robot, whose modules are imported with the first request."""

from __future__ import annotations

from starlette.routing import BaseRoute

from katana450.extensions.late_routes import LateRoutes
from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext


def robot_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes that list robots and upload one."""

    def make() -> list[BaseRoute]:
        from katana450.extensions.robot_choice.robot_routes import routes

        return routes(context)

    return LateRoutes([f"{ROOT}/robots"], make).routes()
