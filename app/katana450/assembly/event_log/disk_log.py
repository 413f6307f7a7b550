"""The event log of one server, written by the process that starts the others and outlives them.

A record is one JSON object per line, of bounded size and without secrets. The process takes records
from all others and writes them in one thread. Nobody waits for the disk. While it is full or cannot
be written, the records are counted, and the thread tries again.
"""

from __future__ import annotations

import json
import logging
import os
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from katana450.arm.runtime.pipes.guarded_pipe import GuardedPipe
from katana450.arm.runtime.readiness import writable
from katana450.platform_support import claim_file, open_bytes, state_folder

log = logging.getLogger(__name__)

Record = dict[str, Any]
"""A record: ``time``, ``t`` and ``kind``, and those of ``who``, ``what``, ``grounds``, ``outcome``
and ``why`` that are known."""

MAX_LINE_BYTES = 4096
"""Maximum length of a line. The content of a longer record is replaced by its length."""

MAX_TEXT = 200
"""Maximum length of a text in a record, in characters."""

PRESENT = "events.jsonl"
"""Name of the file to which records are appended."""

MAX_FILE_BYTES = 10_000_000
"""Maximum size of one file."""

MAX_FILES = 10
"""Maximum number of files; the oldest is deleted when a new one begins."""

MAX_QUEUED = 10_000
"""Maximum number of records that wait for the thread; more are counted and dropped."""

RETRY_INTERVAL = 1.0
"""[s] Time between two attempts to open a log that cannot be written."""

CLOSE_TIMEOUT = 2.0
"""[s] Time in which a slow disk may take the last records."""


class DiskLog:
    """The event log of this server in a folder, which is created when needed."""

    def __init__(
        self,
        folder: Path,
        port: int,
        max_file_bytes: int = MAX_FILE_BYTES,
        max_files: int = MAX_FILES,
    ) -> None:
        """Start the thread, and write the start of the server on ``port``."""
        self._file = LogFile(folder, max_file_bytes, max_files)
        self._queue: SimpleQueue[Record | None] = SimpleQueue()
        self._lost = self._dropped = 0
        self._problem = ""
        self._retry_at = 0.0
        self._pipes: list[Connection] = []
        self._listeners: list[threading.Thread] = []
        self._attaching = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="event log", daemon=True)
        self._thread.start()
        self._note("start", {"port": port, "pid": os.getpid()})

    @property
    def folder(self) -> Path:
        """The folder."""
        return self._file.folder

    def put(self, content: Record) -> None:
        """Write ``content`` soon; drop and count it if too many records wait."""
        if self._queue.qsize() < MAX_QUEUED:
            self._queue.put(content)
        else:
            self._dropped += 1

    def attach(self, pipe: Connection) -> None:
        """Write the records of another process, which sends lists of them by ``pipe``.

        A problem of the writer is sent back as a text, and ``""`` when it is over.
        """
        with self._attaching:
            self._pipes.append(pipe)
            if self._problem:
                _tell(pipe, self._problem)
        thread = threading.Thread(target=self._listen, args=(pipe,), name="records", daemon=True)
        self._listeners = [*filter(threading.Thread.is_alive, self._listeners), thread]
        thread.start()

    def restart(self, process: str, status: int | None) -> None:
        """Record that ``process`` ended with ``status``, and is started again."""
        self._note("restart", {"process": process, "status": status})

    def close(self, *, requested: bool, timeout: float = CLOSE_TIMEOUT) -> None:
        """Record the end of the server, and write what waits. ``requested``: by a signal.

        Return after at most ``timeout`` [s], although a slow disk may need longer.
        """
        end = time.monotonic() + timeout
        for thread in self._listeners:
            thread.join(max(end - time.monotonic(), 0.0))
        cause = "requested" if requested else "the server could not start, or failed"
        self._note("end", {"cause": cause})
        self._queue.put(None)
        self._thread.join(max(end - time.monotonic(), 0.0))

    def _note(self, kind: str, what: dict[str, Any]) -> None:
        self.put(record(kind, what, who={"name": "the server", "channel": "server"}))

    def _listen(self, pipe: Connection) -> None:
        with GuardedPipe(pipe, "The pipe of the event log"):
            while True:
                for content in pipe.recv():
                    self.put(content)
        with self._attaching:
            self._pipes.remove(pipe)
        pipe.close()

    def _run(self) -> None:
        closing = False
        while not closing:
            batch: list[Record | None] = []
            with suppress(Empty):
                batch.append(self._queue.get(timeout=RETRY_INTERVAL if self._problem else None))
                while True:
                    batch.append(self._queue.get_nowait())
            closing = None in batch
            self._write([content for content in batch if content is not None], closing=closing)
        self._file.close()

    def _write(self, batch: list[Record], *, closing: bool) -> None:
        dropped, self._dropped = self._dropped, 0
        self._lost += dropped
        now = time.monotonic()
        if self._problem and now < self._retry_at and not closing:
            self._lost += len(batch)
            return
        left = len(batch)
        try:
            if not self._file.is_open:
                self._file.open()
            if self._lost:
                why = self._problem or "Too many events came at once."
                self._file.append(record("lost", {"count": self._lost}, why=why))
                self._lost = 0
            for content in batch:
                self._file.append(content)
                left -= 1
        except Exception as error:
            # Also of a record that is no JSON: the log continues after every error.
            self._lost += left
            self._fail(error)
        else:
            if self._problem:
                log.warning("The event log in %s is written again.", self._file.folder)
                self._report("")

    def _fail(self, error: Exception) -> None:
        self._file.close()
        self._retry_at = time.monotonic() + RETRY_INTERVAL
        if not self._problem:
            why = error.strerror if isinstance(error, OSError) else None
            if isinstance(error, BlockingIOError):
                why = "another server writes there"
            # Everybody sees this text, so it does not name the folder.
            problem = f"The event log cannot be written: {why or error}."
            log.error("%s Folder: %s. Later records are counted.", problem, self._file.folder)
            self._report(problem)

    def _report(self, problem: str) -> None:
        with self._attaching:
            self._problem = problem
            for pipe in self._pipes:
                _tell(pipe, problem)


def _tell(pipe: Connection, problem: str) -> None:
    """Send ``problem`` to a process that may have ended, or that no longer reads."""
    with suppress(OSError):
        if writable(pipe.fileno()):
            pipe.send(problem)


def default_folder(port: int) -> Path:
    """Return the folder of the event log of the server on ``port``."""
    return state_folder() / "katana450" / "events" / f"port-{port}"


def log_files(folder: Path) -> list[Path]:
    """Return the files of the log in ``folder``, the oldest first."""
    return [*sorted(folder.glob("events-*.jsonl")), *folder.glob(PRESENT)]


class LogFile:
    """Appends records to the log in ``folder``. For one thread.

    Every method may raise OSError. The log then has to be opened again; what was appended before
    stays.
    """

    def __init__(self, folder: Path, max_file_bytes: int, max_files: int) -> None:
        self.folder = folder
        self._max_file_bytes, self._max_files = max_file_bytes, max_files
        self._file, self._size = -1, 0

    @property
    def is_open(self) -> bool:
        """True between ``open`` and ``close``."""
        return self._file >= 0

    def open(self) -> None:
        """Open the present file, and create it if it is missing.

        Raises BlockingIOError if another server writes there.
        """
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self.folder / PRESENT
        self._file = open_bytes(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        try:
            claim_file(self._file)
            self._size = os.fstat(self._file).st_size
            if self._size and not _ends_line(path):
                # A killed server was writing this line.
                self._write(b"\n")
        except OSError:
            self.close()
            raise

    def append(self, record: Record) -> None:
        """Append ``record``; begin a new file before it if the present one is full."""
        line = encoded(record)
        if self._size and self._size + len(line) > self._max_file_bytes:
            self._begin_file()
        self._write(line)

    def close(self) -> None:
        """Close the file; ``open`` opens it again."""
        if self._file >= 0:
            with suppress(OSError):
                os.close(self._file)
        self._file = -1

    def _begin_file(self) -> None:
        """Begin a new file, and delete the oldest ones beyond the maximum."""
        self.close()
        moment = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
        (self.folder / PRESENT).rename(self.folder / f"events-{moment}.jsonl")
        self.open()
        for old in log_files(self.folder)[: -self._max_files]:
            old.unlink()

    def _write(self, line: bytes) -> None:
        """Write all of ``line`` or nothing."""
        try:
            if os.write(self._file, line) != len(line):
                raise OSError(28, "No space left on device", str(self.folder))
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            raise
        self._size += len(line)


def _ends_line(path: Path) -> bool:
    """Return whether the last line of a file with content is complete."""
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read() == b"\n"


def utc(seconds: float) -> str:
    """Return ``seconds`` since the epoch as ISO time in UTC with milliseconds."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"


def record(kind: str, what: Any = None, **more: Any) -> Record:
    """Return a record of the present time. ``more``: further fields."""
    content: Record = {"time": utc(time.time()), "t": round(time.perf_counter(), 3), "kind": kind}
    if what is not None:
        content["what"] = what
    return content | more


def encoded(content: Record) -> bytes:
    """Return ``content`` as a line with its line feed.

    The line is plain ASCII whatever the texts in it: ``json`` escapes line breaks, control
    characters, lone surrogates, and everything else beyond ASCII.
    """
    line = json.dumps(content, separators=(",", ":"))
    if len(line) > MAX_LINE_BYTES:
        short: Record = {key: content[key] for key in ("time", "t", "kind") if key in content}
        line = json.dumps(short | {"what": {"omitted_bytes": len(line)}}, separators=(",", ":"))
    return line.encode("ascii") + b"\n"


def text(value: object) -> str:
    """Return ``value`` as a text of at most ``MAX_TEXT`` characters."""
    words = str(value)
    return words if len(words) <= MAX_TEXT else f"{words[:MAX_TEXT]}... ({len(words)} characters)"
