"""A whole recording with one more message: its data is copied as it is, and gets a new index.

Copying takes less time than to decode and write all messages again.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex, DataEnd, Footer, MessageIndex, SummaryOffset
from mcap.records import Message as McapMessage
from mcap.summary import Summary

from katana450.atomic import write_files
from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import (
    MAX_RECORD_BYTES,
    BoundedStream,
    Message,
    RecordingFile,
)

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file."""

FOOTER = struct.Struct("<BQQQI")
"""Opcode and length of the footer, the begins of summary and offsets, and the checksum."""

DATA_END_BYTES = 13
"""Length of the record between the data and the summary."""


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
    """Write ``data``, ``message`` and the index of both."""
    out.write(data)
    channel = next(each.id for each in summary.channels.values() if each.topic == message.topic)
    _write_chunk(out, summary, channel, message)
    _add_to_statistics(summary, channel, message)
    _write_records(out, [DataEnd(0)])
    _write_summary(out, summary)


def _write_chunk(out: BinaryIO, summary: Summary, channel: int, message: Message) -> None:
    """Write a chunk with ``message`` alone, and note it in the index."""
    at, start = message.log_time, out.tell()
    content = _records([McapMessage(channel, at, message.data, at, message.number)])
    packed = zstandard.compress(content)
    chunk = Chunk("zstd", packed, at, at, zlib.crc32(content), len(content))
    chunk_length = _write_records(out, [chunk])
    index_at = out.tell()
    index_length = _write_records(out, [MessageIndex(channel, [(at, 0)])])
    summary.chunk_indexes.append(
        ChunkIndex(
            chunk_length=chunk_length,
            chunk_start_offset=start,
            compression="zstd",
            compressed_size=len(packed),
            message_end_time=at,
            message_index_length=index_length,
            message_index_offsets={channel: index_at},
            message_start_time=at,
            uncompressed_size=len(content),
        )
    )


def _add_to_statistics(summary: Summary, channel: int, message: Message) -> None:
    statistics = summary.statistics
    assert statistics is not None
    counts = statistics.channel_message_counts
    counts[channel] = counts.get(channel, 0) + 1
    statistics.message_count += 1
    statistics.chunk_count += 1
    statistics.message_start_time = min(statistics.message_start_time, message.log_time)
    statistics.message_end_time = max(statistics.message_end_time, message.log_time)


def _write_summary(out: BinaryIO, summary: Summary) -> None:
    """Write the index and the end of the file."""
    start, groups = out.tell(), []
    content = b""
    for opcode, records in (
        (Opcode.SCHEMA, summary.schemas.values()),
        (Opcode.CHANNEL, summary.channels.values()),
        (Opcode.STATISTICS, [summary.statistics]),
        (Opcode.CHUNK_INDEX, summary.chunk_indexes),
        (Opcode.ATTACHMENT_INDEX, summary.attachment_indexes),
        (Opcode.METADATA_INDEX, summary.metadata_indexes),
    ):
        group = _records(records)
        groups.append(SummaryOffset(opcode, start + len(content), len(group)))
        content += group
    offsets_start = start + len(content)
    content += _records(groups)
    length = FOOTER.size - 9
    checked = struct.pack("<BQQQ", Opcode.FOOTER, length, start, offsets_start)
    checksum = zlib.crc32(checked, zlib.crc32(content))
    out.write(content)
    _write_records(out, [Footer(start, offsets_start, checksum)])
    out.write(MAGIC)


def _records(records: Iterable[Any]) -> bytes:
    """Return ``records`` as bytes."""
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    return bytes(builder.end())


def _write_records(out: BinaryIO, records: Iterable[Any]) -> int:
    """Write ``records`` and return their length."""
    content = _records(records)
    out.write(content)
    return len(content)
