"""Event logs for the tests: written by the real writer, read as records."""

from __future__ import annotations

import json
from pathlib import Path

from katana450.assembly.event_log.disk_log import (
    MAX_FILE_BYTES,
    MAX_FILES,
    DiskLog,
    Record,
    log_files,
    record,
)

CLOSING = 20.0
"""[s] Timeout of the writer's end."""


def write(
    folder: Path,
    contents: list[Record],
    max_file_bytes: int = MAX_FILE_BYTES,
    max_files: int = MAX_FILES,
) -> None:
    """Write ``contents`` between a start and an end."""
    log = DiskLog(folder, 8080, max_file_bytes, max_files)
    for content in contents:
        log.put(content)
    log.close(requested=True, timeout=CLOSING)


def numbered(count: int) -> list[Record]:
    """Return ``count`` different records."""
    return [record("command", {"command": "Joint", "value": n}) for n in range(count)]


def lines(folder: Path) -> list[bytes]:
    """Return all lines of the log, the oldest first."""
    return [line for path in log_files(folder) for line in path.read_bytes().splitlines()]


def records(folder: Path) -> list[Record]:
    """Return all records of the log."""
    return [json.loads(line) for line in lines(folder)]
