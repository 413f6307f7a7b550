"""The process that reads the cameras. A camera that is silent, slow or broken delays nothing else.

It sends the newest pictures to the page's server, and all to the process that records, while these
are connected.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

import msgspec

from katana450.arm.runtime.pipes.guarded_pipe import PIPE_ERRORS
from katana450.arm.runtime.pipes.private_listener import (
    Greeting,
    PrivateAddress,
    PrivateListener,
    Roles,
    connect,
)
from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.errors import KatanaError
from katana450.extension import ServerFacts
from katana450.extensions.cameras.simulated import STATES, StateReceiver
from katana450.extensions.cameras.sources import BROWSER, SIMULATED, CameraFrame, frames
from katana450.platform_support import lower_priority

PAGE, RECORDER, SHARER = "page", "recorder", "sharer"
"""Roles of the page's server, of the process that records, and of the page's server again when it
sends the pictures that people share."""

NOT_SHARED = "Nobody shares this camera yet. Who drives may share one of their own machine."

WAITING = {PAGE: 1, RECORDER: 60}
"""Number of pictures of a camera that wait for each of these, at most; older ones are left out."""

GREETING_SECONDS = 5.0
"""[s] Maximum time for which this process is awaited."""

MAX_PICTURE_BYTES = 5_000_000

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
    """Configuration of the process: addresses of the cameras by name, its own, and the server."""

    sources: Mapping[str, str]
    address: PrivateAddress
    facts: ServerFacts


class CameraReader:
    """Reads the cameras, each in a thread of its own, and sends their pictures."""

    def __init__(
        self,
        sources: Mapping[str, str],
        frames: Callable[[str], Iterator[CameraFrame]] = frames,
    ) -> None:
        """Begin to read ``sources``, the addresses of the cameras by name, by ``frames``."""
        self._frames = frames
        self._changed = threading.Condition()
        self._newest: dict[str, Picture] = {}
        self._names = tuple(sources)
        self._queues: list[dict[str, deque[Picture]]] = []
        for name, address in sources.items():
            if address == BROWSER:
                self._newest[name] = Picture(name, problem=NOT_SHARED)
                continue
            threading.Thread(
                target=self._read, args=(name, address), name=f"camera {name}", daemon=True
            ).start()

    def _read(self, name: str, address: str) -> None:
        logged = ""
        while True:
            try:
                for t, jpeg in self._frames(address):
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
            for queues in self._queues:
                queues[picture.camera].append(picture)
            self._changed.notify_all()

    def take(self, connection: Connection, _greeting: Greeting) -> None:
        """Take the pictures that people share, from the page's server, until that closes."""
        decoder = msgspec.msgpack.Decoder(Picture)
        with suppress(*PIPE_ERRORS):
            while True:
                self._put(decoder.decode(connection.recv_bytes(MAX_PICTURE_BYTES)))

    def send(self, connection: Connection, greeting: Greeting) -> None:
        """Send the newest pictures, and all later ones, until the other end closes ``connection``.

        Of those that come while one is sent, the last ones wait, as many as its role says.
        """
        size = WAITING[greeting.role]
        with self._changed:
            newest = {name: [self._newest[name]] for name in self._newest}
            queues = {name: deque(newest.get(name, []), size) for name in self._names}
            self._queues.append(queues)
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: any(queues.values()))
                    pictures = [picture for queue in queues.values() for picture in queue]
                    for queue in queues.values():
                        queue.clear()
                for picture in pictures:
                    connection.send_bytes(msgspec.msgpack.encode(picture))
        except OSError:
            return
        finally:
            with self._changed:
                self._queues.remove(queues)


def received_pictures(
    address: PrivateAddress, role: str, wanted: Callable[[], bool]
) -> Iterator[Picture | None]:
    """Yield the pictures of the process at ``address`` while they are ``wanted``.

    None stands for the end of a connection, which is made again.
    """
    decoder = msgspec.msgpack.Decoder(Picture)
    while wanted():
        with (
            suppress(*PIPE_ERRORS),
            connect(address, Greeting(role), GREETING_SECONDS) as connection,
        ):
            while wanted():
                if connection.poll(RETRY_SECONDS):
                    yield decoder.decode(connection.recv_bytes(MAX_PICTURE_BYTES))
        yield None
        if wanted():
            time.sleep(RETRY_SECONDS)


def run_cameras(config: CamerasConfig, supervisor: SupervisorPipe) -> None:
    """Read the cameras in this process until the server ends."""
    lower_priority()
    states = StateReceiver(config.facts)

    def frames_of(source: str) -> Iterator[CameraFrame]:
        view = source.removeprefix(SIMULATED)
        return frames(source) if view == source else states.frames(view)

    reader = CameraReader(config.sources, frames_of)
    roles: Roles = {PAGE: reader.send, RECORDER: reader.send, SHARER: reader.take}
    roles[STATES] = states.take
    listener = PrivateListener(config.address, roles, "the process of the cameras")
    listener.start()
    supervisor.report(READY)
    supervisor.ended.wait()
    listener.close()
