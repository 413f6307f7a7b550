"""Reader of recordings. It takes files of anybody: every fault is an InputError.

Memory is bounded: no record is longer than the file, and no chunk unpacks to more than a maximum.
"""

from __future__ import annotations

import io
import math
import re
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, Self

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import InvalidMagic, McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex
from mcap.stream_reader import StreamReader
from mcap.summary import Summary

from katana450.errors import InputError
from katana450.extensions.recording.files.header import METADATA, Attachment, RecordedSettings
from katana450.extensions.recording.forms import FormError, json_form
from katana450.extensions.recording.messages import NANO, nanoseconds

MAX_CHUNK_BYTES = 64_000_000
"""Maximum size of an unpacked chunk. The writer makes chunks of 1 MB and one message more."""

MAX_RECORD_BYTES = 256_000_000
"""Maximum size of a record; only an attachment is that large."""

PART_START: Final = "part_start_s"
"""Name of the metadata with the start of a part that was cut out of a recording [s]."""

HEAD: Final = struct.Struct("<BQ")
"""Operation code and length of a record."""

MESSAGE: Final = struct.Struct("<HIQQ")
"""Start of a message: channel, number of the tick, log time and publish time [ns]."""

CHANNEL_CODE, MESSAGE_CODE = 0x04, 0x05

WHOLE: Final = re.compile(r"-?[0-9]{1,19}")
"""Pattern of a whole number of nanoseconds."""

FAULTS: Final = (
    McapError,
    zstandard.ZstdError,
    struct.error,
    ValueError,
    LookupError,
    OverflowError,
    EOFError,
)
"""Errors that reading a damaged file raises."""


def unreadable(path: Path, error: Exception) -> InputError:
    """Return why the file at ``path`` cannot be read, for one of FAULTS."""
    if isinstance(error, InvalidMagic):
        return InputError(f"{path} is not a recording: it does not begin as MCAP files do.")
    return InputError(f"{path} is not a recording, or is damaged: {error or type(error).__name__}.")


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Raise InputError for the errors of reading the file at ``path``."""
    try:
        yield
    except InputError:
        raise
    except FAULTS as error:
        raise unreadable(path, error) from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error


class Message(NamedTuple):
    """A message: its topic, the number of its tick, its time [ns] and its JSON."""

    topic: str
    number: int
    log_time: int
    data: bytes

    @property
    def t(self) -> float:
        """Time of the message [s]."""
        return self.log_time / NANO


class BoundedStream:
    """A file that refuses to read more than it holds, before any memory is used for that."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.size = file.seek(0, 2)
        """Length of the file [bytes]."""
        file.seek(0)

    def read(self, length: int = -1) -> bytes:
        """Return the next ``length`` bytes. Raises EOFError if there are fewer."""
        left = self.size - self._file.tell()
        if not 0 <= length <= left:
            raise EOFError(f"it ends {length - left} bytes too soon")
        return self._file.read(length)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to ``offset``."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the place in the file."""
        return self._file.tell()

    def seekable(self) -> bool:
        """Return True."""
        return True


def checked_size(chunk: Chunk) -> int:
    """Return the unpacked size of ``chunk`` [bytes]. Raises ValueError for one that is not true."""
    size = len(chunk.data)
    if chunk.compression == "zstd":
        # The unpacker uses as much memory as this says.
        size = zstandard.get_frame_parameters(chunk.data).content_size
    if size != chunk.uncompressed_size:
        raise ValueError("the size of a chunk is wrong")
    return size


def chunk_content(chunk: Chunk, limit: int) -> bytes:
    """Return the records in ``chunk``, of up to ``limit`` bytes. Raises one of FAULTS."""
    if chunk.compression not in ("", "zstd"):
        raise ValueError(f"its chunks are compressed by {chunk.compression!r}, not by zstd")
    size = checked_size(chunk)
    if size > limit:
        raise ValueError(f"a chunk has {size} bytes, more than {limit}")
    content = chunk.data
    if chunk.compression == "zstd":
        content = zstandard.ZstdDecompressor().decompress(chunk.data)
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise ValueError("the checksum of a chunk is wrong")
    return content


def records_in(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield operation code, first byte and end of each record in ``content``."""
    start, size = 0, len(content)
    while start < size:
        code, length = HEAD.unpack_from(content, start)
        start += HEAD.size
        if length > size - start:
            raise EOFError("a record is longer than its chunk")
        yield code, start, start + length
        start += length


def channels_in(content: bytes) -> dict[int, str]:
    """Return the topics of the channels that the records of a chunk describe, by their numbers."""
    channels = [
        Channel.read(ReadDataStream(io.BytesIO(content[start:end])))
        for code, start, end in records_in(content)
        if code == CHANNEL_CODE
    ]
    return {channel.id: channel.topic for channel in channels}


def messages_in(content: bytes, channels: Mapping[int, str]) -> Iterator[Message]:
    """Yield the messages of ``channels`` in the records of a chunk.

    Most messages of a chunk are of others. Skipping these here takes a tenth of the time that a
    reader of whole records takes.
    """
    for code, start, end in records_in(content):
        if code == MESSAGE_CODE:
            channel, number, log_time, _ = MESSAGE.unpack_from(content, start)
            topic = channels.get(channel)
            if topic is not None:
                yield Message(topic, number, log_time, content[start + MESSAGE.size : end])


def records_at(stream: BoundedStream, offset: int) -> Iterator[Any]:
    """Return the records from ``offset`` on, chunks as they are."""
    stream.seek(offset)
    reader = StreamReader(
        stream,  # type: ignore[arg-type]  # it has all that is used of a file
        skip_magic=offset > 0,
        emit_chunks=True,
        record_size_limit=MAX_RECORD_BYTES,
    )
    return iter(reader.records)


def messages_at(
    stream: BoundedStream,
    offset: int,
    channels: Mapping[int, str],
    topics: Collection[str],
    limit: int = MAX_CHUNK_BYTES,
) -> list[Message]:
    """Return the messages of ``topics`` in the chunk at ``offset``, of up to ``limit`` bytes.

    Raises one of FAULTS.
    """
    wanted = {number: topic for number, topic in channels.items() if topic in topics}
    return list(messages_in(content_at(stream, offset, limit), wanted))


def content_at(stream: BoundedStream, offset: int, limit: int) -> bytes:
    """Return the records in the chunk at ``offset``. Raises one of FAULTS."""
    chunk = next(records_at(stream, offset))
    if not isinstance(chunk, Chunk):
        raise ValueError("its index is wrong")
    return chunk_content(chunk, limit)


class RecordingFile:
    """A recording that is read by its index. For use in one thread."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        """Read the index of ``file``; use ``open`` instead."""
        self.path = path
        self._stream = BoundedStream(file)
        with reading(self.path):
            self._reader = SeekingReader(
                self._stream,  # type: ignore[arg-type]  # it has all that is used of a file
                validate_crcs=True,
                record_size_limit=MAX_RECORD_BYTES,
            )
            self.summary = self._summary()
            """Index of the file, as MCAP has it."""
            channels = self.summary.channels.values()
            self._topics = {channel.id: channel.topic for channel in channels}
            self._chunks = sorted(
                self.summary.chunk_indexes, key=lambda record: record.chunk_start_offset
            )
            named = {record.name: dict(record.metadata) for record in self._reader.iter_metadata()}
        if METADATA not in named:
            raise InputError(f"{path} is an MCAP file, but no recording of katana450.")
        self.metadata: Mapping[str, str] = named[METADATA]
        """Texts about the recording by their names."""

    @classmethod
    @contextmanager
    def open(cls, path: Path) -> Iterator[Self]:
        """Yield the open recording at ``path``. Raises InputError if it cannot be read."""
        try:
            file = path.open("rb")
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
        with file:
            yield cls(path, file)

    def _summary(self) -> Summary:
        try:
            summary = self._reader.get_summary()
        except FAULTS as error:
            # The beginning was valid, so the end is missing.
            raise InputError(
                f"{self.path} has no valid end, as after a crash. Repair it with "
                f"`katana450 record recover {self.path}`."
            ) from error
        if summary is None or not summary.channels:
            raise InputError(f"{self.path} has no index, so it is not a whole recording.")
        return summary

    @property
    def start(self) -> float:
        """Time at which the recording begins [s]; 0 if it is empty.

        Ticks before the start of a part that was cut out serve its simulation only.
        """
        first = min((chunk.message_start_time for chunk in self._chunks), default=0) / NANO
        return max(first, part_start_of(self.metadata))

    @property
    def end(self) -> float:
        """Time of the last message [s]; 0 if there is none."""
        return max((chunk.message_end_time for chunk in self._chunks), default=0) / NANO

    @property
    def size(self) -> int:
        """Length of the file [bytes]."""
        return self._stream.size

    @property
    def settings(self) -> RecordedSettings:
        """Settings of the session. Raises InputError for a recording without them."""
        try:
            settings: RecordedSettings = json_form(
                self.metadata.get("settings", ""), RecordedSettings
            )
            return settings
        except FormError as error:
            raise InputError(f"{self.path} does not state the settings of its session.") from error

    @property
    def utc_offset(self) -> float:
        """Seconds to add to the times of the recording for seconds since the epoch."""
        return utc_offset_of(self.metadata)

    def attachments(self) -> Iterator[Attachment]:
        """Yield the files that belong to the recording. Raises InputError."""
        with reading(self.path):
            for file in self._reader.iter_attachments():
                yield Attachment(file.name, file.media_type, file.data, file.log_time)

    def counts(self) -> dict[str, int]:
        """Return the number of messages of each topic; nothing if the file does not state them."""
        if self.summary.statistics is None:
            return {}
        counts = self.summary.statistics.channel_message_counts
        return {topic: counts.get(channel, 0) for channel, topic in self._topics.items()}

    def messages(
        self, *topics: str, start: float = -math.inf, end: float = math.inf
    ) -> Iterator[Message]:
        """Yield the messages of ``topics`` from ``start`` to ``end`` [s], in their order.

        Raises InputError where the file is damaged.
        """
        wanted = frozenset(topics)
        first, last = nanoseconds_of(start), nanoseconds_of(end)
        for index in self._chunks:
            if (
                index.message_end_time >= first
                and index.message_start_time <= last
                and self._has(index, wanted)
            ):
                for message in self._messages(index, wanted):
                    if first <= message.log_time <= last:
                        yield message

    def last_before(self, topic: str, t: float) -> Message | None:
        """Return the last message of ``topic`` at or before ``t`` [s]; None if there is none."""
        wanted = frozenset((topic,))
        for index in reversed(self._chunks):
            if index.message_start_time <= nanoseconds_of(t) and self._has(index, wanted):
                last = nanoseconds_of(t)
                messages = [
                    message for message in self._messages(index, wanted) if message.log_time <= last
                ]
                if messages:
                    return messages[-1]
        return None

    def _has(self, index: ChunkIndex, topics: frozenset[str]) -> bool:
        return any(self._topics.get(channel) in topics for channel in index.message_index_offsets)

    def _messages(self, index: ChunkIndex, topics: frozenset[str]) -> list[Message]:
        with reading(self.path):
            return messages_at(self._stream, index.chunk_start_offset, self._topics, topics)


def part_start_of(metadata: Mapping[str, str]) -> float:
    """Return the start of a part that was cut out of a recording [s]; -inf for a whole one."""
    try:
        return float(metadata.get(PART_START, "-inf"))
    except ValueError:
        return -math.inf


def utc_offset_of(metadata: Mapping[str, str]) -> float:
    """Return the seconds from times of a recording to those since the epoch; 0 if unknown."""
    return utc_offset_ns(metadata) / NANO


def utc_offset_ns(metadata: Mapping[str, str]) -> int:
    """Return that time in nanoseconds, which is exact."""
    text = metadata.get("utc_offset_ns", "")
    return int(text) if WHOLE.fullmatch(text) else 0


def nanoseconds_of(t: float) -> float:
    """Return the log time of ``t`` [s], which may be infinite."""
    return nanoseconds(t) if math.isfinite(t) else t
