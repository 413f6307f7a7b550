"""The folder of an event log: files of chained records, and a head file that names the last one.

The files are named for the sequence number of their first record. Each new file continues the
chain of the file before.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Self

from katana450.extensions.event_log.records import FIRST_HASH, Record, decoded, encoded, hash_of
from katana450.platform_support import claim_file, open_bytes

MAX_FILE_BYTES = 10_000_000
"""Maximum size of one file."""

MAX_FILES = 10
"""Maximum number of files; the oldest is deleted when a new one begins."""

HEAD_NAME = "head"

FILE_NAME = re.compile(r"events-(\d{12,})\.jsonl")

TAIL_BYTES = 65_536
"""Bytes at the end of a file in which its last line is searched; a record is shorter."""


class LogHead(NamedTuple):
    """Sequence number and hash of the last record, and the number of the oldest one kept."""

    seq: int
    hash: str
    oldest: int = 1

    def encoded(self) -> bytes:
        """Return the content of the head file, which always has the same length."""
        return f"{self.seq:016d} {self.hash} {self.oldest:016d}\n".encode()

    @classmethod
    def read(cls, content: bytes) -> Self | None:
        """Return the head in ``content``; None if there is none."""
        found = re.fullmatch(rb"(\d{16}) ([0-9a-f]{64}) (\d{16})\n", content)
        return None if found is None else cls(int(found[1]), found[2].decode(), int(found[3]))


class _Tail(NamedTuple):
    """End of a file: its last record, and what follows it, which is normally nothing."""

    seq: int
    hash: str
    torn: bytes
    ends_line: bool


def log_files(folder: Path) -> list[Path]:
    """Return the files of the log in ``folder``, the oldest first. Raises OSError."""
    return sorted(
        (path for path in folder.iterdir() if FILE_NAME.fullmatch(path.name)), key=first_seq
    )


def first_seq(path: Path) -> int:
    """Return the sequence number in the name of a file of the log."""
    found = FILE_NAME.fullmatch(path.name)
    return 0 if found is None else int(found[1])


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
        self._file = self._head_file = -1
        self._size = 0
        self._unsynced = False
        self.head = LogHead(0, FIRST_HASH)
        """The last record that was appended."""

    @property
    def unsynced(self) -> bool:
        """True if a record may not be on the disk itself yet."""
        return self._unsynced

    @property
    def is_open(self) -> bool:
        """True between ``open`` and ``close``."""
        return self._head_file >= 0

    def open(self) -> Record:
        """Open the log for appending, and create it if it is missing.

        Returns:
            what the next record has to state: ``continues`` names the record before. ``torn``
            describes an incomplete line before it. ``missing`` names the last record that was
            written, if it is not there any more. ``head`` says that the head file is missing.
        """
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._head_file = open_bytes(self.folder / HEAD_NAME, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            claim_file(self._head_file)
            return self._continued(LogHead.read(os.read(self._head_file, 200)))
        except OSError:
            self.close()
            raise

    def append(self, record: Record) -> None:
        """Append ``record``; begin a new file before it if the present one is full."""
        line = encoded(self.head.seq + 1, record, self.head.hash) + b"\n"
        if self._size and self._size + len(line) > self._max_file_bytes:
            self._begin_file()
        self._write(line)
        self.head = LogHead(self.head.seq + 1, hash_of(line[:-1]), self.head.oldest)
        self._unsynced = True

    def commit(self) -> None:
        """Write the head file."""
        os.lseek(self._head_file, 0, os.SEEK_SET)
        os.write(self._head_file, self.head.encoded())

    def sync(self) -> None:
        """Wait until the disk has the records. Raises FileNotFoundError if a file was deleted."""
        if not self._unsynced:
            return
        os.fsync(self._file)
        self._unsynced = False
        if not os.fstat(self._file).st_nlink or not os.fstat(self._head_file).st_nlink:
            raise FileNotFoundError(2, "A file of the log was deleted", str(self.folder))

    def close(self) -> None:
        """Close the files; ``open`` opens them again."""
        for file in (self._file, self._head_file):
            if file >= 0:
                with suppress(OSError):
                    os.close(file)
        self._file = self._head_file = -1
        self._unsynced = False

    def _continued(self, head: LogHead | None) -> Record:
        """Open the newest file, and return what the next record has to state."""
        files = log_files(self.folder)
        # A new file may have been made without a record in it.
        tails = [_tail(path) for path in files[-2:]]
        found = next(
            (LogHead(tail.seq, tail.hash) for tail in reversed(tails) if tail.seq),
            LogHead(0, FIRST_HASH),
        )
        # The memory of this process is newer than a head file that was not written in time.
        known = max((each for each in (head, self.head) if each is not None), key=lambda h: h.seq)
        about: Record = {"continues": {"seq": found.seq, "sha256": found.hash}}
        if files and head is None:
            about["head"] = "missing"
        if known.seq > found.seq:
            about["missing"] = {"seq": known.seq, "sha256": known.hash}
        # Without a head nothing tells whether older files were deleted.
        is_new = head is None and not self.head.seq and files
        oldest = first_seq(files[0]) if is_new else known.oldest
        self.head = LogHead(max(known.seq, found.seq), found.hash, oldest)
        if not files:
            self._begin_file()
            return about
        self._file = open_bytes(files[-1], os.O_WRONLY | os.O_APPEND, 0o600)
        self._size = os.fstat(self._file).st_size
        if not tails[-1].ends_line:
            self._write(b"\n")
        if torn := tails[-1].torn:
            about["torn"] = {"bytes": len(torn), "sha256": hash_of(torn)}
        return about

    def _begin_file(self) -> None:
        """Begin a new file for the next record, and delete the oldest ones beyond the maximum."""
        path = self.folder / f"events-{self.head.seq + 1:012d}.jsonl"
        new = open_bytes(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        if self._file >= 0:
            os.fsync(self._file)
            os.close(self._file)
        self._file, self._size = new, os.fstat(new).st_size
        files = log_files(self.folder)
        old, kept = files[: -self._max_files], files[-self._max_files :]
        if old:
            self.head = self.head._replace(oldest=first_seq(kept[0]))
            # First: after a kill in between, no file is missing that the head still names.
            self.commit()
        for path in old:
            path.unlink()

    def _write(self, line: bytes) -> None:
        """Write all of ``line`` or nothing."""
        try:
            written = os.write(self._file, line)
            if written != len(line):
                raise OSError(28, "No space left on device", str(self.folder))
        except OSError:
            # A part of a line would look like a change of the log.
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            raise
        self._size += len(line)


def _tail(path: Path) -> _Tail:
    """Return the end of the file at ``path``."""
    with path.open("rb") as file:
        # The size decides how much is read: a device has no end.
        size = path.stat().st_size
        file.seek(max(size - TAIL_BYTES, 0))
        content = file.read(min(size, TAIL_BYTES))
    ends_line = not content or content.endswith(b"\n")
    lines = content.split(b"\n")[: -1 if ends_line else None]
    for index in range(len(lines) - 1, -1, -1):
        if ends_line or index < len(lines) - 1:
            record = decoded(lines[index])
            if record is not None:
                torn = b"\n".join(lines[index + 1 :])
                return _Tail(record["seq"], hash_of(lines[index]), torn, ends_line)
    return _Tail(0, "", b"\n".join(lines), ends_line)
