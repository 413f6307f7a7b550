"""Event logs for the tests: written by the real writer, read as records."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest.mock import patch

from katana450.arm.control.lease import SERVER
from katana450.assembly.event_log import disk_log
from katana450.assembly.event_log.disk_log import MAX_FILE_BYTES, MAX_FILES, PRESENT, DiskLog
from katana450.assembly.event_log.record_maker import Record
from katana450.server.service.recorder import Recorder

CLOSING = 20.0
"""[s] Timeout of the writer's end."""


class Writer:
    """A log in ``folder``, and a recorder whose notes it writes."""

    def __init__(
        self, folder: Path, max_bytes: int = MAX_FILE_BYTES, files: int = MAX_FILES
    ) -> None:
        self.recorder = Recorder()
        with patch.multiple(disk_log, MAX_FILE_BYTES=max_bytes, MAX_FILES=files):
            self._log = DiskLog(self.recorder, folder, 8080)

    def note(self, *contents: Any) -> None:
        """Note events that are always recorded, with ``contents``."""
        for content in contents:
            self.recorder.note("refusal", SERVER, content, always=True)

    def close(self) -> None:
        """Write what waits."""
        self._log.close(CLOSING)


def write(folder: Path, *contents: Any, max_bytes: int = MAX_FILE_BYTES, files: int = 10) -> None:
    """Write records with ``contents`` between a start and an end."""
    log = Writer(folder, max_bytes, files)
    log.note(*contents)
    log.close()


def numbered(count: int) -> list[dict[str, int]]:
    """Return the contents of ``count`` different records."""
    return [{"value": n} for n in range(count)]


def log_files(folder: Path) -> list[Path]:
    """Return the files of the log, the oldest first."""
    numbers = {path: int(path.suffix[1:]) for path in folder.glob(f"{PRESENT}.*")}
    return [*sorted(numbers, key=numbers.__getitem__, reverse=True), *folder.glob(PRESENT)]


def lines(folder: Path) -> list[bytes]:
    """Return all lines of the log, the oldest first."""
    return [line for path in log_files(folder) for line in path.read_bytes().splitlines()]


def records(folder: Path) -> list[Record]:
    """Return all records of the log."""
    return [json.loads(line) for line in lines(folder)]
