"""The websocket of rosbridge, and the robot's description with the meshes that it names.

They are those of the exported package for ROS 2. The addresses of the meshes hold a secret of this
server, because viewers load meshes without cookies and headers: a client that has received the
description can load them.
"""

from __future__ import annotations

import asyncio
import functools
import logging
import mimetypes
import secrets
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.errors import RobotDescriptionError
from katana450.extensions.export.urdf_package import packaged
from katana450.extensions.rosbridge.channel import RosChannel, RosLine
from katana450.extensions.rosbridge.publications import Publications
from katana450.server.web.admission import client_of
from katana450.server.web.http_api import RouteContext
from katana450.server.web.program_socket import serve_socket

log = logging.getLogger(__name__)

MESHES = "/rosbridge/meshes"
"""Path of the meshes; the secret and the path of a file follow."""


@functools.cache
def package_of(urdf: Path) -> dict[str, bytes]:
    """Return the files of the package that `export urdf` makes of ``urdf``, by their paths.

    There are none if ``urdf`` is invalid. The first call takes seconds.
    """
    try:
        return packaged(urdf)
    except RobotDescriptionError as error:
        log.warning("There is no /robot_description: %s", error)
        return {}


def ros_routes(context: RouteContext, urdf: Path) -> list[BaseRoute]:
    """Return the routes of websocket and meshes, for the robot of the file ``urdf``."""
    hub, authenticator = context.hub, context.authenticator
    secret = secrets.token_urlsafe(16)

    async def serve(socket: WebSocket) -> None:
        """Serve one client until its websocket closes."""
        # Without an identity the websocket is refused below.
        known = client_of(authenticator, socket) is not None
        files = await asyncio.to_thread(package_of, urdf) if known else {}
        scheme = "https" if authenticator.address.cookies_are_secure else "http"
        folder = f"{scheme}://{socket.headers['host']}{MESHES}/{secret}/"
        text = b"".join(content for path, content in files.items() if path.endswith(".urdf"))
        shown = text.decode().replace('filename="package://', f'filename="{folder}')
        make = functools.partial(RosChannel, publications=Publications(hub, lambda: shown))
        await serve_socket(hub, authenticator, context.budgets, socket, make, RosLine)

    def mesh(request: Request) -> Response:
        """Answer with a file of the description, to everybody who knows its address."""
        key, path = request.path_params["key"].encode(), request.path_params["path"]
        known = secrets.compare_digest(key, secret.encode())
        content = package_of(urdf).get(path) if known else None
        if content is None:
            raise HTTPException(404)
        headers = {
            # Of pages, only those of our site and of `--ros-page` get here.
            "Access-Control-Allow-Origin": "*",
            "Cross-Origin-Resource-Policy": "cross-origin",
            "Cache-Control": "private, max-age=3600",
        }
        kind = mimetypes.guess_type(path)[0] or "application/octet-stream"
        return Response(content, headers=headers, media_type=kind)

    return [
        WebSocketRoute("/rosbridge", serve),
        Route(f"{MESHES}/{{key}}/{{path:path}}", mesh),
    ]
