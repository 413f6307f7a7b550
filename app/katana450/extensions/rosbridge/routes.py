"""The websocket of rosbridge."""

from __future__ import annotations

import asyncio
import functools
import logging
from pathlib import Path

from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.errors import RobotDescriptionError
from katana450.extensions.export.urdf_package import packaged
from katana450.extensions.rosbridge.channel import RosChannel, RosLine
from katana450.extensions.rosbridge.publications import Publications
from katana450.server.web.admission import client_of
from katana450.server.web.http_api import RouteContext
from katana450.server.web.program_socket import serve_socket

log = logging.getLogger(__name__)


@functools.cache
def description_of(urdf: Path) -> str:
    """Return the text of ``urdf`` in the package that `export urdf` makes; "" if it is invalid.

    The first call takes seconds.
    """
    try:
        files = packaged(urdf)
    except RobotDescriptionError as error:
        log.warning("There is no /robot_description: %s", error)
        return ""
    return next(content.decode() for path, content in files.items() if path.endswith(".urdf"))


def ros_routes(context: RouteContext, urdf: Path) -> list[BaseRoute]:
    """Return the route of the websocket, for the robot of the file ``urdf``."""
    hub, authenticator = context.hub, context.authenticator

    async def serve(socket: WebSocket) -> None:
        """Serve one client until its websocket closes."""
        # Without an identity the websocket is refused below.
        known = client_of(authenticator, socket) is not None
        text = await asyncio.to_thread(description_of, urdf) if known else ""
        make = functools.partial(RosChannel, publications=Publications(hub, text))
        await serve_socket(hub, authenticator, context.budgets, socket, make, RosLine)

    return [WebSocketRoute("/rosbridge", serve)]
