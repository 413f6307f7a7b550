"""Pictures of the cameras for the pages: the connection to their process, and the websockets."""

from __future__ import annotations

import asyncio
import math
import struct
import threading
import time
from collections.abc import Callable, Collection, Iterator, Set
from contextlib import contextmanager, suppress
from functools import partial
from http import HTTPStatus
from multiprocessing.connection import Connection

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.websockets import WebSocket, WebSocketDisconnect

from katana450.arm.runtime.pipes.guarded_pipe import PIPE_ERRORS
from katana450.arm.runtime.pipes.private_listener import Greeting, PrivateAddress, connect
from katana450.extensions.cameras.camera_process import (
    GREETING_SECONDS,
    PAGE,
    SHARER,
    Picture,
    received_pictures,
)
from katana450.extensions.cameras.sources import JPEG
from katana450.server.web.admission import client_of
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, TOKEN_REQUIRED, Authenticator
from katana450.server.web.bodies import NOT_NOW, NOT_UNDERSTOOD, body_of
from katana450.server.web.http_api import RouteContext

AGE = struct.Struct("<d")
"""Age of a picture [s] before its JPEG file, in a message to a page."""

NOT_READY = "The cameras are not ready yet. It is tried again each second."

NOT_FOR_VIEWERS = "Only people who may drive see the cameras of this server."

NOT_FOUND, NOT_ALLOWED = 4404, 4403
"""Close codes of a websocket for a camera that there is not, or that the client may not see."""


class CameraLink:
    """The newest picture of each camera, while somebody looks at one."""

    def __init__(self, address: PrivateAddress) -> None:
        """Connect to the process at ``address`` when a page asks for a picture."""
        self._address = address
        self._newest: dict[str, Picture] = {}
        self._lock = threading.Lock()
        self._wakers: set[Callable[[], object]] = set()
        self._receives = False

    @contextmanager
    def watching(self, wake: Callable[[], object]) -> Iterator[None]:
        """Receive pictures meanwhile; ``wake`` is called in another thread with each of them."""
        with self._lock:
            self._wakers.add(wake)
            # The thread of a page that has just left may still run.
            if not self._receives:
                self._receives = True
                threading.Thread(target=self._receive, name="cameras", daemon=True).start()
        try:
            yield
        finally:
            with self._lock:
                self._wakers.discard(wake)

    @property
    def is_watched(self) -> bool:
        """True while somebody looks at a camera."""
        return bool(self._wakers)

    def newest(self, name: str) -> Picture:
        """Return the newest picture of the camera ``name``."""
        return self._newest.get(name) or Picture(name, problem=NOT_READY)

    def _receive(self) -> None:
        while True:
            for picture in received_pictures(self._address, PAGE, lambda: bool(self._wakers)):
                if picture is None:
                    self._newest.clear()
                else:
                    self._put(picture)
            with self._lock:
                if not self._wakers:
                    self._receives = False
                    return

    def _put(self, picture: Picture) -> None:
        with self._lock:
            self._newest[picture.camera] = picture
            for wake in self._wakers:
                with suppress(RuntimeError):  # Its loop has ended.
                    wake()


class CameraSharer:
    """Sends the pictures that people share to the process of the cameras. For any thread."""

    def __init__(self, address: PrivateAddress) -> None:
        """Connect to the process at ``address`` with the first picture."""
        self._address, self._lock = address, threading.Lock()
        self._connection: Connection | None = None

    def send(self, picture: Picture) -> None:
        """Send ``picture``. Raises OSError or EOFError while the process is away."""
        with self._lock:
            if self._connection is None:
                self._connection = connect(self._address, Greeting(SHARER), GREETING_SECONDS)
            try:
                self._connection.send_bytes(msgspec.msgpack.encode(picture))
            except OSError:
                self._connection = None
                raise


MAX_AGE, MAX_SHARED_BYTES = 10.0, 1_000_000
"""[s, bytes] Maximum age and size of a picture that is shared. Many may wait for the recording."""


SILENCE = 2.0
"""[s] Time after the last picture of a page from which another one may share the camera."""


class SharedCameras:
    """Takes pictures of cameras of the machines of people, each by a request.

    A page sends the next one after the answer, so that none waits.
    """

    def __init__(self, context: RouteContext, address: PrivateAddress, names: Set[str]) -> None:
        """Take pictures of the cameras ``names`` for the process at ``address``."""
        self._context, self._sharer = context, CameraSharer(address)
        # The page whose pictures are taken, and the time of its last one [s].
        self._sharing = dict.fromkeys(names, ("", -math.inf))

    async def take(self, request: Request) -> Response:
        """Take a picture, the JPEG file in the body; ``age`` is its age [s], ``page`` its page."""
        self._context.driver(request, "share a camera")
        name, page = request.path_params["name"], request.query_params.get("page", "")
        if name not in self._sharing:
            raise HTTPException(HTTPStatus.NOT_FOUND, f"Nobody can share a camera {name}."[:100])
        sharing, last = self._sharing[name]
        if sharing != page and time.perf_counter() - last < SILENCE:
            raise HTTPException(NOT_NOW, f"Another window shares the camera {name} already.")
        jpeg = await body_of(request, MAX_SHARED_BYTES)
        try:
            age = float(request.query_params.get("age", ""))
        except ValueError:
            age = math.nan
        if not 0.0 <= age <= MAX_AGE or not jpeg.startswith(JPEG):
            why = f"A picture is a JPEG file with an `age` of 0 to {MAX_AGE:g} s."
            raise HTTPException(NOT_UNDERSTOOD, why)
        self._sharing[name] = page, time.perf_counter()
        try:
            picture = Picture(name, time.perf_counter() - age, jpeg)
            await asyncio.to_thread(self._sharer.send, picture)
        except PIPE_ERRORS as error:
            raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, NOT_READY) from error
        return Response(status_code=HTTPStatus.NO_CONTENT)


class CameraSockets:
    """Serves the websocket of each camera.

    A page asks for a picture with any message, and gets the next one that it has not got: its age
    [s] as a float64, and the JPEG file. So a slow page gets fewer pictures, and never old ones.
    A text is the reason why there is no picture.
    """

    def __init__(
        self,
        link: CameraLink,
        authenticator: Authenticator,
        names: Collection[str],
        *,
        drivers_only: bool,
    ) -> None:
        """Serve the cameras ``names`` of ``link``, to people who may drive or to everybody."""
        self._link, self._authenticator = link, authenticator
        self._names, self._drivers_only = names, drivers_only

    async def serve(self, socket: WebSocket) -> None:
        """Serve one websocket until it closes or its client is no longer authorised."""
        await socket.accept()
        identity = client_of(self._authenticator, socket)
        name = socket.path_params["name"]
        if identity is None:
            await socket.close(SIGN_IN_CLOSE_CODE, TOKEN_REQUIRED)
        elif name not in self._names:
            await socket.close(NOT_FOUND, f"There is no camera {name}."[:100])
        elif self._drivers_only and not identity.role.may_drive:
            await socket.close(NOT_ALLOWED, NOT_FOR_VIEWERS)
        else:
            with suppress(WebSocketDisconnect, RuntimeError):
                why = await self._authenticator.run_while_authorised(
                    partial(client_of, self._authenticator, socket), self._send(socket, name)
                )
                if why is not None:
                    await socket.close(SIGN_IN_CLOSE_CODE, why)

    async def _send(self, socket: WebSocket, name: str) -> None:
        new, loop = asyncio.Event(), asyncio.get_running_loop()
        sent: Picture | None = None
        with self._link.watching(partial(loop.call_soon_threadsafe, new.set)):
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                while (picture := self._link.newest(name)) == sent:
                    new.clear()
                    await new.wait()
                sent = picture
                if picture.jpeg:
                    age = time.perf_counter() - picture.t
                    await socket.send_bytes(AGE.pack(age) + picture.jpeg)
                else:
                    await socket.send_text(picture.problem)
