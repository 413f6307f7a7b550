"""Repair of a recording that has no end, or is damaged: its whole chunks become a whole file.

What a damaged chunk held is missing, and the new file says how many ticks that is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import Attachment as McapAttachment
from mcap.records import Chunk, Footer, Metadata

from katana450.atomic import write_files
from katana450.errors import InputError
from katana450.extensions.recording.files.header import METADATA, Attachment
from katana450.extensions.recording.files.recording_file import (
    FAULTS,
    HEAD,
    MAX_CHUNK_BYTES,
    BoundedStream,
    Message,
    RecordingFile,
    channels_in,
    chunk_content,
    messages_in,
    reading,
    records_at,
)
from katana450.extensions.recording.files.recording_writer import MessageWriter
from katana450.extensions.recording.files.trimming import KEY
from katana450.extensions.recording.folders import claimed
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    COMMANDS,
    PLANS,
    SOLIDS,
    TickMessage,
)


@dataclass
class Recovered:
    """Content of a broken file.

    Attributes:
        messages: number of messages.
        start, end: times of the first and last of them [s].
        lost_bytes: bytes of damaged records, and of what follows the last whole one.
        why: what is wrong with the first of them.
        missing_ticks: number of ticks between whole chunks that are lost.
    """

    messages: int = 0
    start: float = 0.0
    end: float = 0.0
    lost_bytes: int = 0
    why: str = ""
    missing_ticks: int = 0

    def __str__(self) -> str:
        ticks = f", with {self.missing_ticks} ticks between others" if self.missing_ticks else ""
        return (
            f"{self.messages} messages over {self.end - self.start:.1f} s are kept; "
            f"{self.lost_bytes} bytes are lost{ticks} ({self.why})"
        )

    def lose(self, count: int, why: str) -> None:
        """Count lost bytes."""
        self.lost_bytes += count
        self.why = self.why or why


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
    with reading(path), path.open("rb") as file:
        if not claimed(file):
            raise InputError(
                f"{path} is being written by a running program: end its recording first."
            )
        metadata, attachments, why = _header(file)
        if metadata is None:
            raise InputError(
                f"{path} cannot be recovered: its beginning is not that of a recording ({why})."
            )
        recovered = Recovered()
        write_files(
            {
                out: lambda target: _write(
                    file, MessageWriter(target, metadata, attachments), recovered
                )
            }
        )
    return recovered


def _header(file: BinaryIO) -> tuple[dict[str, str] | None, list[Attachment], str]:
    """Return the metadata and the attachments of ``file``, and why there are no metadata."""
    recovered = Recovered()
    metadata: dict[str, str] | None = None
    attachments = []
    for record in _records(BoundedStream(file), recovered):
        match record:
            case Metadata(name=name, metadata=texts) if name == METADATA:
                metadata = dict(texts)
            case McapAttachment():
                kind = record.media_type
                attachments.append(Attachment(record.name, kind, record.data, record.log_time))
    return metadata, attachments, recovered.why or "nothing"


def _records(stream: BoundedStream, recovered: Recovered) -> Iterator[Any]:
    """Yield the whole records of ``stream``, and count the bytes of the others."""
    offset = 0
    while True:
        try:
            for record in records_at(stream, offset):
                if isinstance(record, Footer):
                    recovered.why = recovered.why or "its index is wrong"
                yield record
                offset = stream.tell()
            return
        except FAULTS as error:
            # A record that says how long it is can be left out.
            length = _length_at(stream, offset)
            recovered.lose(length, str(error) or type(error).__name__)
            offset += length
            if offset >= stream.size:
                return


def _length_at(stream: BoundedStream, offset: int) -> int:
    """Return the length of the record at ``offset``, or of all from there on if it is unknown."""
    left = stream.size - offset
    if offset == 0 or left < HEAD.size:
        return left
    stream.seek(offset)
    length = HEAD.size + HEAD.unpack(stream.read(HEAD.size))[1]
    return int(min(length, left))


def _write(file: BinaryIO, copy: MessageWriter, recovered: Recovered) -> None:
    """Write the whole chunks of ``file`` to ``copy``, and count them in ``recovered``."""
    topics: dict[int, str] = {}
    # Values that other messages name by their keys, and the number of the newest tick.
    keys: set[bytes] = set()
    newest: int | None = None
    for record in _records(BoundedStream(file), recovered):
        if not isinstance(record, Chunk):
            continue
        try:
            content = chunk_content(record, MAX_CHUNK_BYTES)
            topics.update(channels_in(content))
            messages = list(messages_in(content, topics))
        except FAULTS as error:
            recovered.lose(len(record.data), str(error) or type(error).__name__)
            continue
        for message in messages:
            if message.topic in (PLANS, SOLIDS):
                keys.update(KEY.findall(message.data)[:1])
            elif message.topic in (COMMANDS, CHECKPOINTS) and recovered.lost_bytes:
                if not keys.issuperset(KEY.findall(message.data)):
                    continue
                lost = 0 if newest is None else message.number - newest - 1
                if message.topic == COMMANDS and lost > 0:
                    recovered.missing_ticks += lost
                    copy.copy(_gap(message, lost))
            if message.topic == COMMANDS:
                newest = message.number
            recovered.start = recovered.start if recovered.messages else message.t
            recovered.start = min(recovered.start, message.t)
            recovered.end = max(recovered.end, message.t)
            recovered.messages += 1
            copy.copy(message)
        copy.flush()
    copy.finish()


def _gap(message: Message, ticks: int) -> Message:
    """Return the note that ``ticks`` are missing before ``message``."""
    gap = TickMessage(message.t, missing="This part of the file was damaged.", ticks=ticks)
    return Message(COMMANDS, message.number, message.log_time, json_text(gap))
