"""The websocket of rosbridge, and the robot's description, as in the exported package for ROS 2."""

from __future__ import annotations

import asyncio
import io
import logging
import threading
import zipfile
from functools import partial
from pathlib import Path

from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.arm.control.actor import CommandChannel
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.export.urdf_package import package_files
from katana450.extensions.rosbridge.channel import RosChannel, RosLine
from katana450.extensions.rosbridge.publications import Publications
from katana450.server.service.participants import actor_of
from katana450.server.web.admission import LIMIT_CLOSE_CODE, address_of, client_of, reserved
from katana450.server.web.http_api import RouteContext
from katana450.server.web.limits import ConnectionLimit
from katana450.server.web.program_socket import serve_socket


def description_of(urdf: Path) -> str:
    """Return the URDF of the package that `export urdf` makes of the file ``urdf``.

    Raises RobotDescriptionError.
    """
    (content,) = package_files(urdf).values()
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        (name,) = (path for path in packed.namelist() if path.endswith(".urdf"))
        return packed.read(name).decode()


log = logging.getLogger(__name__)

CLIENTS, CLIENTS_EACH, RESERVED_CLIENTS = 32, 8, 2
"""Maximum of ROS clients, of all together and of one identity, and number reserved for the driver
and for each admin with a link."""


class LateDescription:
    """The robot's description, read in a thread when the first client connects."""

    def __init__(self, urdf: Path) -> None:
        self._urdf = urdf
        self._lock = threading.Lock()
        self._text: str | None = None

    def read(self) -> str:
        """Return the URDF; empty for an invalid file. The first call takes seconds."""
        with self._lock:
            if self._text is None:
                try:
                    self._text = description_of(self._urdf)
                except RobotDescriptionError as error:
                    log.warning("There is no /robot_description: %s", error)
                    self._text = ""
            return self._text


class RosRoutes:
    """The routes of one server."""

    def __init__(self, context: RouteContext, urdf: Path) -> None:
        self._context = context
        self._description = LateDescription(urdf)
        self._places = ConnectionLimit(CLIENTS, CLIENTS_EACH)

    def routes(self) -> list[BaseRoute]:
        """Return the routes."""
        return [WebSocketRoute("/rosbridge", self._serve)]

    async def _serve(self, socket: WebSocket) -> None:
        """Serve one client until its websocket closes."""
        context = self._context
        hub, authenticator = context.hub, context.authenticator
        who = client_of(authenticator, socket)
        session, places = "", 0
        if who is not None:
            session, places = who.session, reserved(hub, authenticator, who, RESERVED_CLIENTS)
        with self._places.taken(session, places) as free:
            if not free:
                why = f"At most {CLIENTS} ROS clients can connect, and {CLIENTS_EACH} of a person."
                if who is not None:
                    actor = actor_of(who, CommandChannel.WEBSOCKET, address_of(socket))
                    hub.recorder.refuse("connection", actor, InputError(why))
                await _refuse(socket, LIMIT_CLOSE_CODE, why)
                return
            # Without an identity the websocket is refused below.
            text = "" if who is None else await asyncio.to_thread(self._description.read)
            make = partial(RosChannel, publications=Publications(hub, lambda: text))
            await serve_socket(hub, authenticator, context.budgets, socket, make, RosLine)


async def _refuse(socket: WebSocket, code: int, why: str) -> None:
    """Close a requested websocket with the reason ``why``, as a status and in the close frame."""
    await socket.accept()
    await RosLine(socket).close(code, why)
