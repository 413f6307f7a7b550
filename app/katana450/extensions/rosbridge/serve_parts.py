"""Options and routes of ``katana450 serve`` for ROS clients and Foxglove."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from katana450.cli.option_values import port
from katana450.extras import require

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.extension import ServerFacts
    from katana450.server.web.http_api import RouteContext


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options of ``katana450 serve`` to ``parser``."""
    parser.add_argument(
        "--ros-page",
        action="append",
        type=_origin,
        default=[],
        metavar="ORIGIN",
        help="let pages of this site, such as http://localhost:3000, drive the arm by "
        "/rosbridge and the API; may be repeated",
    )
    parser.add_argument(
        "--foxglove",
        type=port,
        metavar="PORT",
        help="let Foxglove watch and stop the arm at this port, from this machine only and without "
        "an access link; needs the extra `foxglove`",
    )


def _origin(text: str) -> str:
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.netloc or parts.path.strip("/"):
        raise ArgumentTypeError(f"{text!r} is not an origin such as http://localhost:3000")
    return f"{parts.scheme}://{parts.netloc.lower()}"


def check_installed(options: Namespace, _facts: ServerFacts) -> None:
    """Raise MissingExtraError, before the server starts, if the extra is missing."""
    if options.foxglove is not None:
        require("foxglove", "foxglove", "Connections of Foxglove")


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of ROS clients, and start the server of Foxglove if it is requested."""
    from katana450.extensions.late_routes import LateRoutes

    assert context.options is not None
    urdf = context.options.urdf
    context.authenticator.address.guests.update(context.options.ros_page)
    if context.options.foxglove is not None:
        from katana450.extensions.rosbridge.foxglove_server import start

        start(context.hub, context.options.foxglove)

    def make() -> list[BaseRoute]:
        from katana450.extensions.rosbridge.routes import ros_routes

        return ros_routes(context, urdf)

    return LateRoutes(["/rosbridge"], make).routes()
