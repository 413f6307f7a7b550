"""A whole recording with one more message: its data is copied as it is, and gets a new index.

Copying takes less time than to decode and write all messages again.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Message as McapMessage
from mcap.summary import Summary

from katana450.atomic import write_files
from katana450.errors import InputError
from katana450.extensions.recording.files.mcap_records import (
    DATA_END_BYTES,
    FOOTER,
    MAGIC,
    packed_records,
    write_chunk,
    write_end,
)
from katana450.extensions.recording.files.recording_file import (
    MAX_RECORD_BYTES,
    BoundedStream,
    Message,
    RecordingFile,
)


def append_message(path: Path, message: Message) -> None:
    """Add ``message`` to the whole recording at ``path``, in one step.

    Raises InputError if the file is not a whole recording or cannot be written.
    """
    with RecordingFile.open(path):
        pass
    try:
        with path.open("rb") as file:
            stream = BoundedStream(file)
            reader = SeekingReader(
                stream,  # type: ignore[arg-type]  # it has all that is used of a file
                record_size_limit=MAX_RECORD_BYTES,
            )
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise InputError(f"{path} has no index, so it is not a whole recording.")
            data = _data(path, file)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
    write_files({path: lambda out: _write(out, data, summary, message)})


def _data(path: Path, file: BinaryIO) -> bytes:
    """Return the part of ``file`` before the summary, without the record that ends it."""
    file.seek(-(FOOTER.size + len(MAGIC)), 2)
    opcode, _, summary_start, _, _ = FOOTER.unpack(file.read(FOOTER.size))
    length = summary_start - DATA_END_BYTES
    file.seek(max(length, 0))
    if opcode != Opcode.FOOTER or file.read(1) != bytes([Opcode.DATA_END]):
        raise InputError(f"{path} is damaged: its data has no end.")
    file.seek(0)
    return file.read(length)


def _write(out: BinaryIO, data: bytes, summary: Summary, message: Message) -> None:
    """Write ``data``, ``message`` in a chunk of its own, and the index of both."""
    out.write(data)
    channel = next(each.id for each in summary.channels.values() if each.topic == message.topic)
    at = message.log_time
    content = packed_records([McapMessage(channel, at, message.data, at, message.number)])
    write_chunk(out, summary, content, {channel: [(at, 0)]})
    write_end(out, summary)
