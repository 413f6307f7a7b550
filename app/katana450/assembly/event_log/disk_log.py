"""The event log of one server: its files, and the thread that writes them.

A line is one record, a JSON object in plain ASCII. Nobody waits for the disk. While it is full or
cannot be written, the records are counted, and the thread tries again.
"""

from __future__ import annotations

import json
import logging
import os
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from queue import Empty

from katana450.arm.control.lease import SERVER
from katana450.arm.runtime.clock import MonotonicClock
from katana450.assembly.event_log.record_maker import Record, RecordMaker, record
from katana450.platform_support import claim_file, open_bytes
from katana450.server.service.recorder import Note, Recorder

log = logging.getLogger(__name__)

MAX_LINE_BYTES = 4096
"""Maximum length of a line. The content of a longer record is replaced by its length."""

PRESENT = "events.jsonl"
"""Name of the file to which records are appended."""

MAX_FILE_BYTES = 10_000_000
"""Maximum size of one file."""

MAX_FILES = 10
"""Maximum number of files; the oldest is deleted when a new one begins."""

COLLECTING = 0.02
"""[s] Minimum time between two turns of the thread, so that a stream wakes it rarely."""

TURN = 0.25
"""[s] Maximum time between two turns while a record is due or the log cannot be written."""

RETRY_INTERVAL = 1.0
"""[s] Time between two attempts to open a log that cannot be written."""

CLOSE_TIMEOUT = 2.0
"""[s] Time in which a slow disk may take the last records."""


class DiskLog:
    """Writes the notes of ``recorder`` to a folder, which is created when needed."""

    def __init__(
        self,
        recorder: Recorder,
        folder: Path,
        port: int,
        max_file_bytes: int = MAX_FILE_BYTES,
        max_files: int = MAX_FILES,
    ) -> None:
        """Start the thread, and write the start of the server on ``port``."""
        self._recorder = recorder
        self._maker = RecordMaker()
        self._file = LogFile(folder, max_file_bytes, max_files)
        self._lost, self._retry_at = 0, 0.0
        self._now = MonotonicClock().now
        self._thread = threading.Thread(target=self._run, name="event log", daemon=True)
        recorder.enabled = True
        self._port = port
        self._thread.start()

    def close(self, timeout: float = CLOSE_TIMEOUT) -> None:
        """Write the end of the server after all notes.

        Return after at most ``timeout`` [s], although a slow disk may need longer.
        """
        self._recorder.note("end", SERVER)
        self._recorder.enabled = False
        self._recorder.notes.put(None)
        self._thread.join(timeout)

    def _run(self) -> None:
        closing, recorder = False, self._recorder
        # Before notes that waited for this thread.
        what = {"port": self._port, "pid": os.getpid()}
        who = {"name": SERVER.name, "channel": SERVER.channel.value}
        self._write([record("start", what, who=who)], closing=False)
        while not closing:
            notes: list[Note | None] = []
            waits = self._maker.is_idle and not recorder.problem
            with suppress(Empty):
                notes.append(recorder.notes.get(timeout=None if waits else TURN))
                while True:
                    notes.append(recorder.notes.get_nowait())
            closing = None in notes
            records = self._made([note for note in notes if note is not None], closing=closing)
            self._write(records, closing=closing)
            time.sleep(0.0 if closing else COLLECTING)
        self._file.close()

    def _made(self, notes: list[Note], *, closing: bool) -> list[Record]:
        lost, self._recorder.lost = self._recorder.lost, 0
        self._lost += lost
        try:
            return self._maker.made(notes, self._now(), closing=closing)
        except Exception:
            log.exception("The event log met an error; it continues with the next event.")
            self._lost += len(notes)
            return []

    def _write(self, records: list[Record], *, closing: bool) -> None:
        problem, left = self._recorder.problem, len(records)
        if problem and time.monotonic() < self._retry_at and not closing:
            self._lost += left
            return
        try:
            if not self._file.is_open:
                self._file.open()
            if self._lost:
                why = problem or "Too many events came at once."
                self._file.append(record("lost", {"count": self._lost}, why=why))
                self._lost = 0
            for content in records:
                self._file.append(content)
                left -= 1
        except Exception as error:
            # Also of a record that is no JSON: the log continues after every error.
            self._lost += left
            self._fail(error)
        else:
            if problem:
                log.warning("The event log in %s is written again.", self._file.folder)
                self._recorder.problem = ""

    def _fail(self, error: Exception) -> None:
        self._file.close()
        self._retry_at = time.monotonic() + RETRY_INTERVAL
        if not self._recorder.problem:
            why = error.strerror if isinstance(error, OSError) else None
            if isinstance(error, BlockingIOError):
                why = "another server writes there"
            # Everybody sees this text, so it does not name the folder.
            problem = f"The event log cannot be written: {why or error}."
            log.error("%s Folder: %s. Later records are counted.", problem, self._file.folder)
            self._recorder.problem = problem


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
