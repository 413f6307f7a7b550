"""The event log of one server, written by the process that starts the others and outlives them.

It takes records from all processes and writes them in one thread. Nobody waits for the disk. While
it is full or cannot be written, the records are counted, and the thread tries again.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from katana450.arm.runtime.pipes.guarded_pipe import GuardedPipe
from katana450.arm.runtime.readiness import writable
from katana450.assembly.event_log.log_files import MAX_FILE_BYTES, MAX_FILES, LogFile
from katana450.assembly.event_log.records import Record, record
from katana450.platform_support import state_folder

log = logging.getLogger(__name__)

MAX_QUEUED = 10_000
"""Maximum number of records that wait for the thread; more are counted and dropped."""

RETRY_INTERVAL = 1.0
"""[s] Time between two attempts to open a log that cannot be written."""

SYNC_INTERVAL = 1.0
"""[s] Maximum time after which a record is on the disk itself, and not only with the system."""

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
        self._retry_at = self._sync_at = 0.0
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
                waits = self._problem or self._file.unsynced
                batch.append(self._queue.get(timeout=SYNC_INTERVAL if waits else None))
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
            if now >= self._sync_at or closing:
                self._file.sync()
                self._sync_at = now + SYNC_INTERVAL
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
