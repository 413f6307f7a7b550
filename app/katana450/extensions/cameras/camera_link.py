"""Pictures of the cameras for the pages: the connection to their process, and the websockets."""

from __future__ import annotations

import asyncio
import struct
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from functools import partial

from starlette.websockets import WebSocket, WebSocketDisconnect

from katana450.arm.runtime.pipes.private_listener import PrivateAddress
from katana450.extensions.cameras.camera_process import PAGE, Picture, received_pictures
from katana450.server.web.admission import client_of
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, TOKEN_REQUIRED, Authenticator

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
