"""The recordings that a server plays back: its own last minutes, and files that people opened.

A file is decoded in a process of its own, so that it neither stops the page's server for a moment
nor fills its memory. The process runs this module with the file as its argument. It limits its
memory before it reads the file, answers requests one after another, and ends with its input. A
request is a JSON line, ``[method, arguments]``. An answer is a pickle after its length: whether it
was successful, and the result or the reason.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import secrets
import shutil
import struct
import subprocess
import sys
import threading
import time
import weakref
from argparse import Namespace
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, BinaryIO
from weakref import WeakKeyDictionary

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.recording.files.attempts import Attempt, attempt_at, parted
from katana450.extensions.recording.files.simulation import state_after
from katana450.extensions.recording.files.spans import Span
from katana450.extensions.recording.folders import SUFFIX, default_folder, recordings_in
from katana450.extensions.recording.messages import StateRow, TickMessage
from katana450.extensions.recording.playback.difference import (
    AttemptDifference,
    AttemptResult,
    difference,
)
from katana450.extensions.recording.playback.marks import Mark
from katana450.extensions.recording.playback.rows import RecordedMoment
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.extensions.recording.ticks import TickInput
from katana450.platform_support import limit_resources, without_interrupts
from katana450.resources import URDF_PATH
from katana450.server.service.limits import BoundedWork

if TYPE_CHECKING:
    from katana450.server.service.hub import Hub

TIMEOUT = 30.0
"""[s] Timeout of a request to the process."""

WATCH_PERIOD = 0.5
"""[s] Time between two looks at how long a request takes."""

MAX_ANSWER_BYTES = 64_000_000
"""Maximum size of an answer; a moment has some kilobytes, and 2 MB with many solids."""

MAX_MEMORY_BYTES = 3_000_000_000
"""Maximum address space, a part of which libraries only reserve."""

MAX_SECONDS = 3600
"""[s] Maximum processor time of all requests for one file."""

LENGTH = struct.Struct("<Q")
"""Length of an answer [bytes]."""


class OpenedRun:
    """The run in one file, with the methods of ``PlaybackRun``. For any thread.

    The process is started with the first request, and again after one that it did not survive.
    """

    def __init__(self, path: Path) -> None:
        """Read the file at ``path``, which does not change."""
        self._path = path
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._asked: float | None = None
        self.spans: tuple[Span, ...] = ()
        """The times with records; empty before ``update``."""
        self.metadata: Mapping[str, str] = {}
        """Texts about the file."""

    def update(self) -> None:
        """Read the index of the file, once. Raises InputError if it cannot be read."""
        if not self.spans:
            self._ask("update")
            self.spans, self.metadata = self._ask("about")

    def marks(self) -> list[Mark]:
        """See ``PlaybackRun.marks``."""
        marks: list[Mark] = self._ask("marks")
        return marks

    def attempts(self) -> list[Attempt]:
        """See ``PlaybackRun.attempts``."""
        attempts: list[Attempt] = self._ask("attempts")
        return attempts

    def rows(self, spans: Sequence[tuple[float, float]]) -> list[StateRow]:
        """See ``PlaybackRun.rows``."""
        rows: list[StateRow] = self._ask("rows", spans)
        return rows

    def at(self, t: float) -> RecordedMoment | None:
        """See ``PlaybackRun.at``."""
        moment: RecordedMoment | None = self._ask("at", t)
        return moment

    def input_until(self, t: float) -> list[State | TickInput | TickMessage]:
        """See ``PlaybackRun.input_until``."""
        tick_inputs: list[State | TickInput | TickMessage] = self._ask("input_until", t)
        return tick_inputs

    def picture(self, camera: str, t: float) -> bytes | None:
        """See ``PlaybackRun.picture``."""
        picture: bytes | None = self._ask("picture", camera, t)
        return picture

    def close(self) -> None:
        """End the process, without waiting for a request that it works on."""
        process = self._process
        if process is not None:
            process.kill()

    def _ask(self, method: str, *arguments: Any) -> Any:
        """Return the result of ``method`` in the process. Raises InputError with the reason."""
        with self._lock:
            again = self._process is None and method != "update"
            process = self._started()
            self._asked = time.monotonic()
            try:
                if again:
                    _request(process, "update", ())
                successful, result = _request(process, method, arguments)
            except (OSError, EOFError) as error:
                self._end()
                raise InputError(
                    f"The file could not be decoded within {TIMEOUT:g} s and the memory that one "
                    "file may take."
                ) from error
            finally:
                self._asked = None
        if not successful:
            raise InputError(result)
        return result

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            self._process = subprocess.Popen(
                (sys.executable, "-P", "-m", __spec__.name, str(self._path)),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                **without_interrupts(),
            )
            weakref.finalize(self, _end, self._process)
            # One thread for all requests: to start one for each would take most of their time.
            watch = (weakref.ref(self), self._process)
            threading.Thread(target=_watch, args=watch, name="decoder", daemon=True).start()
        return self._process

    def _end(self) -> None:
        if self._process is not None:
            _end(self._process)
            self._process = None


def _watch(reference: weakref.ref[OpenedRun], process: subprocess.Popen[bytes]) -> None:
    """Kill ``process`` when it hangs, so that the pipe with its answer ends."""
    while process.poll() is None:
        time.sleep(WATCH_PERIOD)
        run = reference()
        start = None if run is None else run._asked
        del run
        if start is not None and time.monotonic() - start > TIMEOUT:
            process.kill()


def _request(process: subprocess.Popen[bytes], method: str, arguments: Sequence[Any]) -> Any:
    """Return the answer of ``process``. Raises EOFError or OSError if it has ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps((method, arguments)).encode() + b"\n")
    process.stdin.flush()
    head = process.stdout.read(LENGTH.size)
    length = LENGTH.unpack(head)[0] if len(head) == LENGTH.size else MAX_ANSWER_BYTES + 1
    if length > MAX_ANSWER_BYTES:
        raise EOFError
    content = process.stdout.read(length)
    if len(content) != length:
        raise EOFError
    return pickle.loads(content)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill ``process`` and close its pipes."""
    process.kill()
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):
            if pipe is not None:
                pipe.close()
    process.wait()


def answer(run: PlaybackRun, request: bytes) -> bytes:
    """Return the answer to ``request``, with its length before it."""
    method, arguments = json.loads(request)
    try:
        if method == "about":
            result: tuple[bool, Any] = True, (run.spans, run.metadata)
        else:
            result = True, getattr(run, method)(*arguments)
    except InputError as error:
        result = False, str(error)
    except MemoryError:
        result = False, "The file needs too much memory."
    content = pickle.dumps(result, pickle.HIGHEST_PROTOCOL)
    return LENGTH.pack(len(content)) + content


def serve(path: Path, requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer ``requests`` about the file ``path`` until they end."""
    run = PlaybackRun(lambda: [path])
    for request in requests:
        answers.write(answer(run, request))
        answers.flush()


RING = "ring"
"""Name of the last minutes that the server has recorded itself."""

MAX_FILE_BYTES = 1_000_000_000
"""Maximum size of a file: four minutes with three cameras, half a day of motion without any."""

PREFIX = "katana450-opened-"
"""Start of the names of the temporary folders of servers."""

AnyRun = PlaybackRun | OpenedRun
"""The last minutes, or an opened file."""

AT_ONCE, WAITING = 2, 8
"""Maximum number of requests that are worked on, and that wait, at the same time."""

FULL = "Too many people play back at once. Wait a moment."

MAX_FILES = 4
"""Number of opened files that are kept; the one that was opened first is closed."""


class RecordingStore:
    """Runs by their names, and the work on them. For one thread, except for the runs themselves."""

    def __init__(self, ring: Path | None, urdf: Path | None = None) -> None:
        """Offer the ring in the folder ``ring``, if there is one.

        ``urdf``: the robot of the server; None for that of the app.
        """
        self.ring, self._urdf = ring, urdf or URDF_PATH
        self._temporary = Path(mkdtemp(prefix=PREFIX))
        weakref.finalize(self, shutil.rmtree, self._temporary, ignore_errors=True)
        self._ring = None if ring is None else PlaybackRun(lambda: recordings_in(ring))
        self._files: OrderedDict[str, tuple[Path, OpenedRun]] = OrderedDict()
        self.work = BoundedWork(AT_ONCE, WAITING, FULL)
        """The work on the runs, in threads."""

    async def state_at(self, name: str, t: float, session: Session) -> State:
        """Return the state of the run ``name`` at ``t`` [s since the epoch], by ``session``.

        Raises InputError if it cannot be simulated exactly, as for another robot.
        """
        run = self.run(name)

        def simulated() -> State:
            self._check_robot(run)
            return state_after(session, run.input_until(t))

        return await self.work.result(simulated)

    async def difference(
        self, name: str, moments: tuple[float, float], session: Session
    ) -> AttemptDifference:
        """Return that of the attempts at two ``moments`` [s since the epoch] of the run ``name``.

        Raises InputError for a damaged file, and for a state that cannot be simulated exactly.
        """
        run = self.run(name)

        def compared() -> AttemptDifference:
            self._check_robot(run)
            attempts = run.attempts()
            first, second = (attempt_at(attempts, t) for t in moments)
            results = [
                AttemptResult(spans, run.rows(spans), state_after(session, run.input_until(end)))
                for spans, end in zip(
                    parted(first.path, second.path), (first.end, second.end), strict=True
                )
            ]
            return difference(session, *results)

        return await self.work.result(compared)

    def run(self, name: str) -> AnyRun:
        """Return the run ``name``. Raises InputError if there is none."""
        if name == RING:
            if self._ring is None:
                raise InputError("This server records nothing, so there are no last minutes.")
            return self._ring
        if name not in self._files:
            raise InputError("The server no longer has that recording. Open its file again.")
        return self._files[name][1]

    def _check_robot(self, run: AnyRun) -> None:
        """Read what was added to ``run``. Raises InputError for one of another robot."""
        run.update()
        if self.is_of_another_robot(run):
            raise InputError("The recording is of another robot, whose states do not fit.")

    def is_of_another_robot(self, run: AnyRun) -> bool:
        """Return whether ``run`` is that of another robot than the server's."""
        digest = hashlib.sha256(self._urdf.read_bytes()).hexdigest()
        return run.metadata.get("urdf_sha256") != digest

    def file(self, name: str) -> Path:
        """Return the file of the opened recording ``name``. Raises InputError."""
        self.run(name)
        return self._files[name][0]

    def new_path(self) -> Path:
        """Return the path for a file that is being received."""
        return self._temporary / f"{secrets.token_hex(8)}{SUFFIX}"

    def new_folder(self) -> Path:
        """Return a new folder for a file that is being made."""
        return Path(mkdtemp(dir=self._temporary))

    def add(self, path: Path, run: OpenedRun) -> str:
        """Keep ``run`` of the file ``path``, and return its name."""
        self._files[path.stem] = path, run
        while len(self._files) > MAX_FILES:
            _, (old, run) = self._files.popitem(last=False)
            run.close()
            old.unlink(missing_ok=True)
        return path.stem


_stores: WeakKeyDictionary[Hub, RecordingStore] = WeakKeyDictionary()
_making = threading.Lock()


def store_of(hub: Hub, options: Namespace | None) -> RecordingStore:
    """Return the recordings of the server of ``hub``, always the same. For any thread."""
    with _making:
        store = _stores.get(hub)
        if store is None:
            ring: Path | None = None
            if options is not None and not options.no_record:
                ring = options.record or default_folder(hub.stop_path.main_port)
            store = _stores[hub] = RecordingStore(ring, getattr(options, "urdf", None))
        return store


def opened(path: Path) -> OpenedRun:
    """Return the run in the file ``path``. Raises InputError if it is not a recording."""
    run = OpenedRun(path)
    try:
        run.update()
    except InputError as error:
        # The path is one of this server, which says nothing to the person.
        raise InputError(str(error).replace(str(path), "The file")) from error
    if not run.spans:
        raise InputError("The file is not a recording of katana450, or has no motion.")
    return run


if __name__ == "__main__":
    limit_resources(MAX_MEMORY_BYTES, MAX_SECONDS)
    serve(Path(sys.argv[1]), sys.stdin.buffer, sys.stdout.buffer)
