"""Records of MCAP files: chunks with their indexes, and the summary at the end."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Mapping
from typing import Any, BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex, DataEnd, Footer, MessageIndex, SummaryOffset
from mcap.summary import Summary

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file."""

FOOTER = struct.Struct("<BQQQI")
"""Opcode and length of the footer, the begins of summary and offsets, and the checksum."""

PACKING = zstandard.ZstdCompressionParameters(
    strategy=zstandard.STRATEGY_BTOPT,
    window_log=18,
    hash_log=15,
    chain_log=15,
    search_log=2,
    min_match=3,
    target_length=64,
)
"""Parameters for digits: a tenth smaller than by default, in 40 instead of 3 us for a tick."""

DATA_END_BYTES = 13
"""Length of the record between the data and the summary."""

Index = Mapping[int, list[tuple[int, int]]]
"""Time [ns] and place of each message of a chunk, by the number of its channel."""


def write_records(out: BinaryIO, records: Iterable[Any]) -> int:
    """Write ``records`` and return their length."""
    content = packed_records(records)
    out.write(content)
    return len(content)


def packed_records(records: Iterable[Any]) -> bytes:
    """Return ``records`` as bytes."""
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    return bytes(builder.end())


def write_chunk(out: BinaryIO, summary: Summary, content: bytes, index: Index) -> None:
    """Write a chunk with the records ``content``, and add it to ``summary``.

    ``index``: the messages in it, of which there is at least one.
    """
    times = [at for places in index.values() for at, _ in places]
    first, last = min(times), max(times)
    packed = zstandard.ZstdCompressor(compression_params=PACKING).compress(content)
    start = out.tell()
    chunk = Chunk("zstd", packed, last, first, zlib.crc32(content), len(content))
    chunk_length = write_records(out, [chunk])
    index_at, places_at = out.tell(), {}
    indexes = b""
    for channel, places in index.items():
        places_at[channel] = index_at + len(indexes)
        indexes += packed_records([MessageIndex(channel, places)])
    out.write(indexes)
    summary.chunk_indexes.append(
        ChunkIndex(
            chunk_length=chunk_length,
            chunk_start_offset=start,
            compression="zstd",
            compressed_size=len(packed),
            message_end_time=last,
            message_index_length=len(indexes),
            message_index_offsets=places_at,
            message_start_time=first,
            uncompressed_size=len(content),
        )
    )
    statistics = summary.statistics
    assert statistics is not None
    earlier = statistics.message_start_time if statistics.message_count else first
    statistics.message_start_time = min(first, earlier)
    statistics.message_end_time = max(last, statistics.message_end_time)
    statistics.message_count += len(times)
    statistics.chunk_count += 1
    counts = statistics.channel_message_counts
    for channel, places in index.items():
        counts[channel] = counts.get(channel, 0) + len(places)


def write_end(out: BinaryIO, summary: Summary) -> None:
    """Write the end of the data, and ``summary`` as the index of the file."""
    write_records(out, [DataEnd(0)])
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
        group = packed_records(records)
        groups.append(SummaryOffset(opcode, start + len(content), len(group)))
        content += group
    offsets_start = start + len(content)
    content += packed_records(groups)
    length = FOOTER.size - 9
    checked = struct.pack("<BQQQ", Opcode.FOOTER, length, start, offsets_start)
    checksum = zlib.crc32(checked, zlib.crc32(content))
    out.write(content)
    write_records(out, [Footer(start, offsets_start, checksum)])
    out.write(MAGIC)
