"""The websocket of rosbridge, and the robot's description with the meshes that it names.

The meshes are those of the exported package for ROS 2: OBJ files, one for each colour. Their
addresses hold a secret of this server, because viewers load meshes without cookies and headers. A
client that has received the description can load them.
"""

from __future__ import annotations

import asyncio
import io
import logging
import secrets
import threading
import zipfile
from functools import partial
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.arm.control.actor import CommandChannel
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.export.urdf_package import package_files
from katana450.extensions.rosbridge.channel import Endpoint, RosChannel, RosLine
from katana450.extensions.rosbridge.publications import Publications
from katana450.extensions.rosbridge.servoing import Units
from katana450.server.service.participants import actor_of
from katana450.server.web.admission import LIMIT_CLOSE_CODE, address_of, client_of, reserved
from katana450.server.web.channel import BAD_REQUEST_CLOSE_CODE
from katana450.server.web.http_api import RouteContext
from katana450.server.web.limits import ConnectionLimit
from katana450.server.web.program_socket import serve_socket

MESHES = "/rosbridge/meshes"
"""Path of the meshes; the secret and the name of a file follow."""

TYPES = {
    ".obj": "model/obj",
    ".mtl": "model/mtl",
    ".stl": "model/stl",
    ".dae": "model/vnd.collada+xml",
    ".glb": "model/gltf-binary",
    ".gltf": "model/gltf+json",
    ".png": "image/png",
    ".jpg": "image/jpeg",
}
"""Types of the files by their suffixes."""


class RobotPackage(NamedTuple):
    """A robot's description with its files.

    Attributes:
        text: the URDF; its meshes have the prefix ``package``.
        package: prefix of the meshes, ``package://NAME/``.
        files: content of each file by its path in the package.
        key: secret in the addresses of the files.
    """

    text: str
    package: str
    files: dict[str, bytes]
    key: str

    @classmethod
    def read(cls, urdf: Path, key: str) -> RobotPackage:
        """Return the description of the file ``urdf``. Raises RobotDescriptionError."""
        ((name, content),) = package_files(urdf).items()
        package = PurePosixPath(name).stem
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            files = {
                path.removeprefix(f"{package}/"): packed.read(path) for path in packed.namelist()
            }
        text = next(files[path] for path in files if path.endswith(".urdf")).decode()
        meshes = {path: data for path, data in files.items() if path.startswith("meshes/")}
        return cls(text, f"package://{package}/", meshes, key)

    def at(self, origin: str) -> str:
        """Return the text whose meshes are at ``origin``, such as http://127.0.0.1:8080."""
        return self.text.replace(self.package, f"{origin}{MESHES}/{self.key}/")


log = logging.getLogger(__name__)

CLIENTS, CLIENTS_EACH, RESERVED_CLIENTS = 32, 8, 2
"""Maximum of ROS clients, of all together and of one identity, and number reserved for the driver
and for each admin with a link."""

UNITS = "command_in_type"
"""Name of the parameter in the address with the units of commands."""


class LateDescription:
    """The robot's description, read in a thread when the first client wants it.

    Attributes:
        key: secret in the addresses of the files.
    """

    def __init__(self, urdf: Path) -> None:
        self.key = secrets.token_urlsafe(16)
        self._urdf = urdf
        self._lock = threading.Lock()
        self._found: RobotPackage | RobotDescriptionError | None = None

    def read(self) -> RobotPackage:
        """Return the description; the first call takes seconds. For any other thread.

        Raises RobotDescriptionError for an invalid file.
        """
        with self._lock:
            if self._found is None:
                try:
                    self._found = RobotPackage.read(self._urdf, self.key)
                except RobotDescriptionError as error:
                    self._found = error
            if isinstance(self._found, RobotDescriptionError):
                raise self._found
            return self._found


class RosRoutes:
    """The routes of one server."""

    def __init__(self, context: RouteContext, urdf: Path) -> None:
        self._context = context
        self._description = LateDescription(urdf)
        self._places = ConnectionLimit(CLIENTS, CLIENTS_EACH)

    def routes(self) -> list[BaseRoute]:
        """Return the routes."""
        return [
            WebSocketRoute("/rosbridge", self._serve),
            Route(f"{MESHES}/{{key}}/{{path:path}}", self._mesh),
        ]

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
            try:
                units = Units(socket.query_params.get(UNITS, Units.UNITLESS.value))
                scheme = "https" if authenticator.address.cookies_are_secure else "http"
                origin = f"{scheme}://{socket.headers['host']}"
                # Without an identity the websocket is refused below.
                text = "" if who is None else await self._text(origin)
            except ValueError:
                known = " or ".join(choice.value for choice in Units)
                await _refuse(socket, BAD_REQUEST_CLOSE_CODE, f"`{UNITS}` must be {known}.")
                return
            except RobotDescriptionError as error:
                log.warning("There is no /robot_description: %s", error)
                text = ""
            endpoint = Endpoint(Publications(hub, lambda: text), units)
            make = partial(RosChannel, endpoint=endpoint)
            await serve_socket(hub, authenticator, context.budgets, socket, make, RosLine)

    async def _text(self, origin: str) -> str:
        return (await asyncio.to_thread(self._description.read)).at(origin)

    async def _mesh(self, request: Request) -> Response:
        """Answer with a file of the description, to everybody who knows its address."""
        key = request.path_params["key"].encode()
        if not secrets.compare_digest(key, self._description.key.encode()):
            raise HTTPException(404)
        try:
            package = await asyncio.to_thread(self._description.read)
        except RobotDescriptionError as error:
            raise HTTPException(404, str(error)) from error
        content = package.files.get(request.path_params["path"])
        if content is None:
            raise HTTPException(404)
        suffix = PurePosixPath(request.path_params["path"]).suffix.lower()
        headers = {
            # Of pages, only those of our site and of `--ros-page` get here.
            "Access-Control-Allow-Origin": "*",
            "Cross-Origin-Resource-Policy": "cross-origin",
            "Cache-Control": "private, max-age=3600",
        }
        return Response(
            content, headers=headers, media_type=TYPES.get(suffix, "application/octet-stream")
        )


async def _refuse(socket: WebSocket, code: int, why: str) -> None:
    """Close a requested websocket with the reason ``why``, as a status and in the close frame."""
    await socket.accept()
    await RosLine(socket).close(code, why)
