"""The event log of one server: its files, and the thread that writes them.

A line is one record, a JSON object in plain ASCII. Nobody waits for the disk. While it is full or
cannot be written, the records are counted, and the thread tries again.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import time
from contextlib import suppress
from io import TextIOWrapper
from logging.handlers import RotatingFileHandler
from pathlib import Path
from queue import Empty

from katana450.arm.control.lease import SERVER
from katana450.arm.runtime.clock import MonotonicClock
from katana450.assembly.event_log.record_maker import Record, RecordMaker, record
from katana450.platform_support import claim_file
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

    def __init__(self, recorder: Recorder, folder: Path, port: int) -> None:
        """Start the thread, and write the start of the server on ``port``."""
        self._recorder = recorder
        self._maker = RecordMaker()
        self._folder, self._files = folder, LogFiles(folder)
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
        self._files.close()

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
            if self._lost:
                why = problem or "Too many events came at once."
                self._files.append(record("lost", {"count": self._lost}, why=why))
                self._lost = 0
            for content in records:
                self._files.append(content)
                left -= 1
        except Exception as error:
            # Also of a record that is no JSON: the log continues after every error.
            self._lost += left
            self._fail(error)
        else:
            if problem:
                log.warning("The event log in %s is written again.", self._folder)
                self._recorder.problem = ""

    def _fail(self, error: Exception) -> None:
        self._files.close()
        self._retry_at = time.monotonic() + RETRY_INTERVAL
        if not self._recorder.problem:
            why = error.strerror if isinstance(error, OSError) else None
            if isinstance(error, BlockingIOError):
                why = "another server writes there"
            # Everybody sees this text, so it does not name the folder.
            problem = f"The event log cannot be written: {why or error}."
            log.error("%s Folder: %s. Later records are counted.", problem, self._folder)
            self._recorder.problem = problem


class LogFiles(RotatingFileHandler):
    """Appends records to the log in a folder, and begins new files. For one thread."""

    def __init__(self, folder: Path) -> None:
        """Open nothing yet. The folder is created when it is needed."""
        super().__init__(
            folder / PRESENT, "a", MAX_FILE_BYTES, MAX_FILES - 1, encoding="ascii", delay=True
        )

    def append(self, content: Record) -> None:
        """Append ``content``, in a new file if the present one is full.

        Raises OSError, of which BlockingIOError if another server writes there, and every error of
        a record that is no JSON.
        """
        self.emit(logging.makeLogRecord({"msg": encoded(content)}))

    def _open(self) -> TextIOWrapper:
        path = Path(self.baseFilename)
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.touch(0o600)
        file = super()._open()
        try:
            claim_file(file.fileno())
            if file.tell() and path.read_bytes()[-1:] != b"\n":
                # A killed server, or one without room on the disk, was writing this line.
                file.write("\n")
        except OSError:
            file.close()
            raise
        return file

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: ARG002
        """Let ``append`` raise the error."""
        error = sys.exception()
        assert error is not None
        raise error

    def close(self) -> None:
        """Close the file; ``append`` opens it again."""
        with suppress(OSError):
            super().close()


def encoded(content: Record) -> str:
    """Return ``content`` as a line without its line feed.

    The line is plain ASCII whatever the texts in it: ``json`` escapes line breaks, control
    characters, lone surrogates, and everything else beyond ASCII.
    """
    line = json.dumps(content, separators=(",", ":"))
    if len(line) > MAX_LINE_BYTES:
        short: Record = {key: content[key] for key in ("time", "t", "kind") if key in content}
        line = json.dumps(short | {"what": {"omitted_bytes": len(line)}}, separators=(",", ":"))
    return line
