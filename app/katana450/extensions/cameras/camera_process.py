"""The process that reads the cameras. A camera that is silent, slow or broken delays nothing else.

It keeps the newest picture of each camera alone, and sends it to the page's server, when that asks.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

import msgspec

from katana450.arm.runtime.pipes.private_listener import Greeting, PrivateAddress, PrivateListener
from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.errors import KatanaError
from katana450.extensions.cameras.sources import frames
from katana450.platform_support import lower_priority

PAGE = "page"
"""Role of the page's server."""

RETRY_SECONDS = 1.0
"""[s] Time after the end of a camera's pictures until it is tried again."""

log = logging.getLogger(__name__)


class Picture(msgspec.Struct, frozen=True, array_like=True):
    """The newest picture of a camera, or why there is none.

    Attributes:
        camera: name of the camera.
        t: time of its receipt on the clock of the session [s].
        jpeg: the picture as a JPEG file; empty if there is none.
        problem: a sentence on why there is none.
    """

    camera: str
    t: float = 0.0
    jpeg: bytes = b""
    problem: str = ""


@dataclass(frozen=True)
class CamerasConfig:
    """Configuration of the process: addresses of the cameras by name, and its own address."""

    sources: Mapping[str, str]
    address: PrivateAddress


class CameraReader:
    """Reads the cameras, each in a thread of its own, and keeps their newest pictures."""

    def __init__(self, sources: Mapping[str, str]) -> None:
        """Begin to read ``sources``, the addresses of the cameras by name."""
        self._changed = threading.Condition()
        self._newest: dict[str, Picture] = {}
        for name, address in sources.items():
            threading.Thread(
                target=self._read, args=(name, address), name=f"camera {name}", daemon=True
            ).start()

    def _read(self, name: str, address: str) -> None:
        logged = ""
        while True:
            try:
                for t, jpeg in frames(address):
                    logged = ""
                    self._put(Picture(name, t, jpeg))
            except KatanaError as error:
                problem = f"The camera {name} {error}. It is tried again each second."
                self._put(Picture(name, problem=problem))
                if problem != logged:
                    log.warning("%s", problem)
                logged = problem
            threading.Event().wait(RETRY_SECONDS)

    def _put(self, picture: Picture) -> None:
        with self._changed:
            self._newest[picture.camera] = picture
            self._changed.notify_all()

    def send(self, connection: Connection, _greeting: Greeting) -> None:
        """Send each newest picture by ``connection``, until the other end closes it.

        Pictures that come while one is sent are left out.
        """
        sent: dict[str, Picture] = {}
        with suppress(OSError):
            while True:
                for picture in self._newer(sent):
                    connection.send_bytes(msgspec.msgpack.encode(picture))
                    sent[picture.camera] = picture

    def _newer(self, sent: Mapping[str, Picture]) -> list[Picture]:
        """Return the newest pictures that are not in ``sent``, as soon as there is one."""

        def newer() -> list[Picture]:
            return [new for name, new in self._newest.items() if new is not sent.get(name)]

        with self._changed:
            return self._changed.wait_for(newer)


def run_cameras(config: CamerasConfig, supervisor: SupervisorPipe) -> None:
    """Read the cameras in this process until the server ends."""
    lower_priority()
    reader = CameraReader(config.sources)
    listener = PrivateListener(config.address, {PAGE: reader.send}, "the process of the cameras")
    listener.start()
    supervisor.report(READY)
    supervisor.ended.wait()
    listener.close()
