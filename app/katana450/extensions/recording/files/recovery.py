"""Repair of a recording whose writer was killed: the whole chunks of it become a whole file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import Attachment as McapAttachment
from mcap.records import Channel, Chunk, Footer, Metadata
from mcap.records import Message as McapMessage

from katana450.atomic import write_files
from katana450.errors import InputError
from katana450.extensions.recording.files.copying import RecordingCopy
from katana450.extensions.recording.files.header import METADATA, Attachment
from katana450.extensions.recording.files.recording_file import (
    FAULTS,
    BoundedStream,
    Message,
    RecordingFile,
    records_at,
    unpacked,
)
from katana450.extensions.recording.state_message import NANO
from katana450.platform_support import claim_file


@dataclass(frozen=True)
class Recovered:
    """Content of a broken file.

    Attributes:
        messages: number of messages.
        start, end: times of the first and last of them [s].
        lost_bytes: bytes after the last whole chunk, which are lost.
        why: what is wrong with them.
    """

    messages: int
    start: float
    end: float
    lost_bytes: int
    why: str

    def __str__(self) -> str:
        return (
            f"{self.messages} messages over {self.end - self.start:.1f} s are kept; "
            f"{self.lost_bytes} bytes at the end are lost ({self.why})"
        )


@dataclass
class _Found:
    """The valid beginning of a file."""

    metadata: dict[str, str] = field(default_factory=dict)
    attachments: list[Attachment] = field(default_factory=list)
    valid_bytes: int = 0
    why: str = "nothing"
    count: int = 0
    start: float = 0.0
    end: float = 0.0


def is_whole(path: Path) -> bool:
    """Return whether the recording at ``path`` can be opened. Raises InputError for no file."""
    try:
        with RecordingFile.open(path) as file:
            # An index of damaged chunks is no whole file.
            for _ in file.messages(*file.counts()):
                pass
    except InputError:
        if not path.is_file():
            raise
        return False
    return True


def recover(path: Path, out: Path) -> Recovered | None:
    """Write the valid part of the recording at ``path`` as a whole file to ``out``.

    ``out`` may be ``path`` itself, which is then replaced in one step. Returns None, and writes
    nothing, if the recording is whole. Raises InputError if nothing in it can be read, and for a
    file that a running server has claimed.
    """
    if is_whole(path):
        return None
    try:
        with path.open("rb") as file:
            _check_unclaimed(path, file)
            found = _scan(file)
            if not found.metadata:
                raise InputError(
                    f"{path} cannot be recovered: its beginning is not that of a recording "
                    f"({found.why})."
                )
            write_files({out: lambda target: _write(file, found, target)})
            size = BoundedStream(file).size
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
    lost = size - found.valid_bytes
    return Recovered(found.count, found.start, found.end, lost, found.why)


def _check_unclaimed(path: Path, file: BinaryIO) -> None:
    """Raise InputError if another process has claimed ``file``, whose end is still to come."""
    try:
        claim_file(file.fileno())
    except (BlockingIOError, PermissionError) as error:
        raise InputError(
            f"{path} is being written by a running program: end its recording first."
        ) from error
    except OSError:
        # Some file systems have no claims.
        return


def _scan(file: BinaryIO) -> _Found:
    """Return what the valid beginning of ``file`` holds."""
    found, stream = _Found(), BoundedStream(file)
    try:
        for record in records_at(stream, 0):
            match record:
                case Metadata(name=name, metadata=metadata) if name == METADATA:
                    found.metadata = dict(metadata)
                case McapAttachment():
                    name, kind = record.name, record.media_type
                    found.attachments.append(Attachment(name, kind, record.data, record.log_time))
                case Chunk():
                    times = [
                        each.log_time / NANO
                        for each in unpacked(record)
                        if isinstance(each, McapMessage)
                    ]
                    if times:
                        found.start = min(times) if not found.count else found.start
                        found.end = max(found.end, *times)
                        found.count += len(times)
                case Footer():
                    found.why = "its index is wrong"
            found.valid_bytes = stream.tell()
    except FAULTS as error:
        found.why = str(error) or type(error).__name__
    return found


def _write(file: BinaryIO, found: _Found, target: BinaryIO) -> None:
    """Write the valid part of ``file`` to ``target``."""
    copy = RecordingCopy(target, found.metadata, found.attachments)
    stream = BoundedStream(file)
    topics: dict[int, str] = {}
    for record in records_at(stream, 0):
        if isinstance(record, Chunk):
            for each in unpacked(record):
                _copy(copy, topics, each)
            copy.flush()
        if stream.tell() >= found.valid_bytes:
            break
    copy.close()


def _copy(copy: RecordingCopy, topics: dict[int, str], record: Any) -> None:
    if isinstance(record, Channel):
        topics[record.id] = record.topic
    elif isinstance(record, McapMessage):
        topic = topics.get(record.channel_id, "")
        copy.add(Message(topic, record.sequence, record.log_time, record.data))
