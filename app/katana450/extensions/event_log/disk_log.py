"""The event log of one server, written by the process that starts the others and outlives them.

It takes records from all processes and writes them in one thread. Nobody waits for the disk. While
it is full or cannot be written, the writer keeps the first records, counts the others, and tries
again.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from argparse import Namespace
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from katana450.arm.runtime.guarded_pipe import GuardedPipe
from katana450.arm.runtime.readiness import writable
from katana450.extensions.event_log.folder import MAX_FILE_BYTES, MAX_FILES, LogFolder
from katana450.extensions.event_log.records import Record, record
from katana450.platform_support import state_folder
from katana450.server.service.server_log import ServerLog

log = logging.getLogger(__name__)

MAX_QUEUED = 10_000
"""Maximum number of records that wait for the thread; more are counted and dropped."""

MAX_KEPT = 256
"""Maximum number of records that are kept while the log cannot be written."""

RETRY_INTERVAL = 1.0
"""[s] Time between two attempts to open a log that cannot be written."""

SYNC_INTERVAL = 1.0
"""[s] Maximum time after which a record is on the disk itself, and not only with the system."""


class LogWriter:
    """Writes records to a folder. Every method returns at once, and may be called in any thread."""

    def __init__(
        self, folder: Path, max_file_bytes: int = MAX_FILE_BYTES, max_files: int = MAX_FILES
    ) -> None:
        """Start the thread; the folder and its files are created when needed."""
        self._folder = LogFolder(folder, max_file_bytes, max_files)
        self._queue: SimpleQueue[Record | None] = SimpleQueue()
        self._kept: deque[Record] = deque()
        self._lost = self._dropped = 0
        self._failing: str | None = None
        self._retry_at = self._sync_at = 0.0
        self._finding_t = float("-inf")
        self._pipes: list[Connection] = []
        self._listeners: list[threading.Thread] = []
        self._attaching = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="event log", daemon=True)
        self._thread.start()

    @property
    def seq(self) -> int:
        """Number of the last record that was written; 0 before the first."""
        return self._folder.seq

    @property
    def folder(self) -> Path:
        """The folder of the log."""
        return self._folder.folder

    def put(self, content: Record) -> None:
        """Write ``content`` soon; drop and count it if too many records wait."""
        if self._queue.qsize() < MAX_QUEUED:
            self._queue.put(content)
        else:
            self._dropped += 1

    def attach(self, pipe: Connection) -> None:
        """Write the records of another process, which sends lists of them by ``pipe``.

        Problems of the writer are sent back as texts, and ``""`` when they are over.
        """
        with self._attaching:
            self._pipes.append(pipe)
            if self._failing is not None:
                _tell(pipe, self._failing)
        thread = threading.Thread(target=self._listen, args=(pipe,), name="records", daemon=True)
        self._listeners = [*(each for each in self._listeners if each.is_alive()), thread]
        thread.start()

    def close(self, last: Record, timeout: float) -> None:
        """Write what the other processes have sent, then ``last``, and end the thread.

        Return after at most ``timeout`` [s], although a slow disk may need longer.
        """
        end = time.monotonic() + timeout
        for thread in self._listeners:
            thread.join(max(end - time.monotonic(), 0.0))
        self.put(last)
        self._queue.put(None)
        self._thread.join(max(end - time.monotonic(), 0.0))

    def _listen(self, pipe: Connection) -> None:
        # A new front end reports the findings again that the arm still remembers.
        known = self._finding_t
        with GuardedPipe(pipe, "The pipe of the event log"):
            while True:
                for content in pipe.recv():
                    if content["kind"] == "finding":
                        if content["t"] <= known:
                            continue
                        self._finding_t = max(self._finding_t, content["t"])
                    self.put(content)
        with self._attaching:
            self._pipes.remove(pipe)
        pipe.close()

    def _run(self) -> None:
        closing = False
        while not closing:
            batch: list[Record | None] = []
            with suppress(Empty):
                batch.append(self._queue.get(timeout=self._pause()))
                while True:
                    batch.append(self._queue.get_nowait())
            closing = None in batch
            self._write([content for content in batch if content is not None], closing=closing)
        self._folder.close()

    def _pause(self) -> float | None:
        """Return the time until the thread has to work without a new record [s]."""
        if self._failing is not None:
            return RETRY_INTERVAL
        return SYNC_INTERVAL if self._folder.unsynced else None

    def _write(self, batch: list[Record], *, closing: bool) -> None:
        dropped, self._dropped = self._dropped, 0
        free = len(batch)
        if self._failing is not None:
            # After a lost record every later one is lost until that is written: the order holds.
            free = 0 if self._lost else max(MAX_KEPT - len(self._kept), 0)
        self._kept += batch[:free]
        self._lost += dropped + len(batch) - len(batch[:free])
        now = time.monotonic()
        if self._failing is not None and now < self._retry_at and not closing:
            return
        try:
            self._append_all()
            if now >= self._sync_at or closing:
                self._folder.sync()
                self._sync_at = now + SYNC_INTERVAL
        except OSError as error:
            self._fail(error)
        except Exception:
            log.exception("The event log met an error; it continues with the next record.")
            lost = record("lost", {"count": len(self._kept)}, why="The event log met an error.")
            self._kept = deque([lost])
            self._folder.close()
        else:
            self._note_success()

    def _append_all(self) -> None:
        """Write the kept records, and how many were lost. Raises OSError."""
        folder = self._folder
        if not folder.is_open:
            folder.open()
        while self._kept or self._lost:
            if self._kept:
                content = self._kept[0]
            else:
                why = self._failing or "Too many events came at once."
                content = record("lost", {"count": self._lost}, why=why)
            folder.append(content)
            if self._kept:
                self._kept.popleft()
            else:
                self._lost = 0

    def _fail(self, error: OSError) -> None:
        self._folder.close()
        self._retry_at = time.monotonic() + RETRY_INTERVAL
        while len(self._kept) > MAX_KEPT:
            self._kept.pop()
            self._lost += 1
        if self._failing is None:
            why = error.strerror or str(error)
            if isinstance(error, BlockingIOError):
                why = "another server writes there"
            # Everybody sees this text, so it does not name the folder.
            self._failing = f"The event log cannot be written: {why}."
            log.error("%s Folder: %s. Later records are counted.", self._failing, self.folder)
            self._tell_all(self._failing)

    def _note_success(self) -> None:
        if self._failing is not None:
            self._failing = None
            log.warning("The event log in %s is written again.", self.folder)
            self._tell_all("")

    def _tell_all(self, text: str) -> None:
        with self._attaching:
            for pipe in self._pipes:
                _tell(pipe, text)


def _tell(pipe: Connection, text: str) -> None:
    """Send ``text`` to a process that may have ended, or that no longer reads."""
    with suppress(OSError):
        if writable(pipe.fileno()):
            pipe.send(text)


CLOSE_TIMEOUT = 2.0
"""[s] Time in which a slow disk may take the last records."""


def default_folder(port: int) -> Path:
    """Return the folder of the event log of the server on ``port``."""
    return state_folder() / "katana450" / "events" / f"port-{port}"


class DiskLog(ServerLog):
    """The event log of this server in a folder."""

    def __init__(self, folder: Path, port: int) -> None:
        """Write to ``folder``, first the start of the server on ``port``."""
        self._writer = LogWriter(folder)
        self._writer.put(_by_server("start", {"port": port, "pid": os.getpid()}))

    @property
    def description(self) -> tuple[str, ...]:
        """The folder, as a line for the terminal."""
        return (f"Event log: {self._writer.folder}",)

    def attach(self, pipe: Connection) -> None:
        """Write the records that another process sends by ``pipe``."""
        self._writer.attach(pipe)

    def restart(self, process: str, status: int | None) -> None:
        """Record that ``process`` ended with ``status``, and is started again."""
        self._writer.put(_by_server("restart", {"process": process, "status": status}))

    def close(self, *, requested: bool) -> None:
        """Record the end of the server, and write what waits. ``requested``: by a signal."""
        what = {"cause": "requested" if requested else "the server could not start, or failed"}
        self._writer.close(_by_server("end", what), CLOSE_TIMEOUT)


def disk_log(options: Namespace, port: int) -> DiskLog | None:
    """Return the event log of the server on ``port``; None if the options choose none."""
    return None if options.no_log else DiskLog(options.log or default_folder(port), port)


def _by_server(kind: str, what: dict[str, Any]) -> Record:
    return record(kind, what, who={"name": "the server", "channel": "server"})
