"""Event logs for the tests: written by the real writer, read as records."""

from __future__ import annotations

from pathlib import Path

from katana450.assembly.event_log.disk_log import DiskLog
from katana450.assembly.event_log.log_files import MAX_FILE_BYTES, MAX_FILES, lines_of, log_files
from katana450.assembly.event_log.records import Record, record

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


def records(folder: Path) -> list[Record]:
    """Return all records of the log."""
    entries = [line.record for line in lines_of(folder)]
    return [entry for entry in entries if entry is not None]


def newest(folder: Path) -> Path:
    """Return the newest file of the log."""
    return log_files(folder)[-1]
