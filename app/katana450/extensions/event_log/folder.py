"""The folder of an event log: files of records, named for the number of their first record."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from katana450.errors import InputError
from katana450.extensions.event_log.records import Record, decoded, encoded
from katana450.platform_support import claim_file, open_bytes

MAX_FILE_BYTES = 10_000_000
"""Maximum size of one file."""

MAX_FILES = 10
"""Maximum number of files; the oldest is deleted when a new one begins."""

CLAIM_NAME = "claim"
"""Name of the file that the writer of a folder keeps locked."""

FILE_NAME = re.compile(r"events-(\d{12,})\.jsonl")

TAIL_BYTES = 65_536
"""Bytes at the end of a file in which its last record is searched; a record is shorter."""

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
    """Return the files of the log in ``folder``, the oldest first. Raises OSError."""
    return sorted(
        (path for path in folder.iterdir() if FILE_NAME.fullmatch(path.name)), key=_first_seq
    )


def lines_of(folder: Path) -> Iterator[StoredLine]:
    """Yield the lines of the log in ``folder``, the oldest first.

    Raises InputError if there is no log or a file cannot be read.
    """
    try:
        paths = log_files(folder)
        if not paths:
            raise InputError(f"There is no event log in {folder}.")
        for path in paths:
            with path.open("rb") as file:
                number = 0
                while line := file.readline(MAX_READ_BYTES):
                    number += 1
                    yield StoredLine(path, number, decoded(line))
    except FileNotFoundError as error:
        raise InputError(f"There is no event log in {folder}.") from error
    except OSError as error:
        raise InputError(f"{error.filename or folder} cannot be read: {error.strerror}.") from error


class LogFolder:
    """Appends records to the log in a folder. For one thread.

    Every method may raise OSError. The log then has to be opened again; what was appended before
    stays.
    """

    def __init__(
        self, folder: Path, max_file_bytes: int = MAX_FILE_BYTES, max_files: int = MAX_FILES
    ) -> None:
        self.folder = folder
        self._max_file_bytes = max_file_bytes
        self._max_files = max_files
        self._file = self._claim = -1
        self._size = 0
        self._unsynced = False
        self.seq = 0
        """Number of the last record that was appended; 0 before the first."""

    @property
    def unsynced(self) -> bool:
        """True if a record may not be on the disk itself yet."""
        return self._unsynced

    @property
    def is_open(self) -> bool:
        """True between ``open`` and ``close``."""
        return self._claim >= 0

    def open(self) -> None:
        """Open the log for appending, and create it if it is missing."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._claim = open_bytes(self.folder / CLAIM_NAME, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            claim_file(self._claim)
            self._open_newest()
        except OSError:
            self.close()
            raise

    def append(self, record: Record) -> None:
        """Append ``record``; begin a new file before it if the present one is full."""
        line = encoded(self.seq + 1, record) + b"\n"
        if self._size and self._size + len(line) > self._max_file_bytes:
            self._begin_file()
        self._write(line)
        self.seq += 1
        self._unsynced = True

    def sync(self) -> None:
        """Wait until the disk has the records. Raises FileNotFoundError if a file was deleted."""
        if not self._unsynced:
            return
        os.fsync(self._file)
        self._unsynced = False
        if not os.fstat(self._file).st_nlink or not os.fstat(self._claim).st_nlink:
            raise FileNotFoundError(2, "A file of the log was deleted", str(self.folder))

    def close(self) -> None:
        """Close the files; ``open`` opens them again."""
        for file in (self._file, self._claim):
            if file >= 0:
                with suppress(OSError):
                    os.close(file)
        self._file = self._claim = -1
        self._unsynced = False

    def _open_newest(self) -> None:
        """Open the newest file, and take the number of its last record."""
        files = log_files(self.folder)
        if not files:
            self._begin_file()
            return
        seq, ends_line = _tail(files[-1])
        # The memory of this process is newer if files were deleted.
        self.seq = max(self.seq, seq)
        self._file = open_bytes(files[-1], os.O_WRONLY | os.O_APPEND, 0o600)
        self._size = os.fstat(self._file).st_size
        if not ends_line:
            # A killed server was writing this line.
            self._write(b"\n")

    def _begin_file(self) -> None:
        """Begin a new file for the next record, and delete the oldest ones beyond the maximum."""
        path = self.folder / f"events-{self.seq + 1:012d}.jsonl"
        new = open_bytes(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        if self._file >= 0:
            os.fsync(self._file)
            os.close(self._file)
        self._file, self._size = new, os.fstat(new).st_size
        for old in log_files(self.folder)[: -self._max_files]:
            old.unlink()

    def _write(self, line: bytes) -> None:
        """Write all of ``line`` or nothing."""
        try:
            written = os.write(self._file, line)
            if written != len(line):
                raise OSError(28, "No space left on device", str(self.folder))
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            raise
        self._size += len(line)


def _first_seq(path: Path) -> int:
    """Return the number in the name of a file of the log."""
    name = FILE_NAME.fullmatch(path.name)
    return 0 if name is None else int(name[1])


def _tail(path: Path) -> tuple[int, bool]:
    """Return the number of the last record in the file, and whether its last line ends."""
    with path.open("rb") as file:
        # The size decides how much is read: a device has no end.
        size = path.stat().st_size
        file.seek(max(size - TAIL_BYTES, 0))
        content = file.read(min(size, TAIL_BYTES))
    records = filter(None, map(decoded, reversed(content.split(b"\n"))))
    # A new file may have been made without a record in it.
    last = next(records, {"seq": _first_seq(path) - 1})
    return last["seq"], not content or content.endswith(b"\n")
