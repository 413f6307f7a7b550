"""Options and routes of ``katana450 serve`` for ROS clients."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

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


def _origin(text: str) -> str:
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.netloc or parts.path.strip("/"):
        raise ArgumentTypeError(f"{text!r} is not an origin such as http://localhost:3000")
    return f"{parts.scheme}://{parts.netloc.lower()}"


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes of ROS clients."""
    from katana450.extensions.late_routes import LateRoutes

    assert context.options is not None
    urdf = context.options.urdf
    context.authenticator.address.guests.update(context.options.ros_page)

    def make() -> list[BaseRoute]:
        from katana450.extensions.rosbridge.routes import ros_routes

        return ros_routes(context, urdf)

    return LateRoutes(["/rosbridge"], make).routes()
