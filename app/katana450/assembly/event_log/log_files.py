"""The files of an event log: the present one, and those that were full."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from katana450.assembly.event_log.records import Record, decoded, encoded
from katana450.errors import InputError
from katana450.platform_support import claim_file, open_bytes

PRESENT = "events.jsonl"
"""Name of the file to which records are appended."""

MAX_FILE_BYTES = 10_000_000
"""Maximum size of one file."""

MAX_FILES = 10
"""Maximum number of files; the oldest is deleted when a new one begins."""

MAX_READ_BYTES = 1_000_000
"""Maximum length of a line that is read at once; the writer's lines are much shorter."""


class StoredLine(NamedTuple):
    """One line of a log. ``record`` is None if the line holds none."""

    path: Path
    number: int
    record: Record | None

    @property
    def place(self) -> str:
        """File and line, for messages."""
        return f"{self.path.name}, line {self.number}"


def log_files(folder: Path) -> list[Path]:
    """Return the files of the log in ``folder``, the oldest first."""
    return [*sorted(folder.glob("events-*.jsonl")), *folder.glob(PRESENT)]


def lines_of(folder: Path) -> Iterator[StoredLine]:
    """Yield the lines of the log in ``folder``, the oldest first.

    Raises InputError if there is no log or a file cannot be read.
    """
    paths = log_files(folder)
    if not paths:
        raise InputError(f"There is no event log in {folder}.")
    for path in paths:
        try:
            with path.open("rb") as file:
                number = 0
                while line := file.readline(MAX_READ_BYTES):
                    number += 1
                    yield StoredLine(path, number, decoded(line))
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}.") from error


class LogFile:
    """Appends records to the log in ``folder``. For one thread.

    Every method may raise OSError. The log then has to be opened again; what was appended before
    stays.

    Attributes:
        folder: The folder of the log.
        unsynced: Whether a record may not be on the disk itself yet.
    """

    def __init__(self, folder: Path, max_file_bytes: int, max_files: int) -> None:
        self.folder = folder
        self.unsynced = False
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
        self.unsynced = True

    def sync(self) -> None:
        """Wait until the disk has the records. Raises FileNotFoundError if a file was deleted."""
        if not self.unsynced:
            return
        os.fsync(self._file)
        self.unsynced = False
        if not os.fstat(self._file).st_nlink:
            raise FileNotFoundError(2, "A file of the log was deleted", str(self.folder))

    def close(self) -> None:
        """Close the file; ``open`` opens it again."""
        if self._file >= 0:
            with suppress(OSError):
                os.close(self._file)
        self._file, self.unsynced = -1, False

    def _begin_file(self) -> None:
        """Begin a new file, and delete the oldest ones beyond the maximum."""
        self.sync()
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
