"""Reader of recordings. It takes files of anybody: every fault is an InputError.

Memory is bounded: no record is longer than the file, and no chunk unpacks to more than a maximum.
"""

from __future__ import annotations

import io
import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, Self

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Attachment as McapAttachment
from mcap.records import Channel, Chunk, Metadata
from mcap.stream_reader import StreamReader

from katana450.errors import InputError
from katana450.extensions.recording.files.header import METADATA, Attachment, RecordedSettings
from katana450.extensions.recording.forms import FormError, json_form
from katana450.extensions.recording.messages import CAMERAS, NANO, nanoseconds

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

TIMES: Final = struct.Struct("<QQQ")
"""Start of a chunk: its first and last time [ns], and its unpacked size [bytes]."""

INDEX: Final = struct.Struct("<HI")
"""Start of the index of a chunk: channel, and length of the places of its messages [bytes]."""

PLACE_BYTES: Final = 16
"""Length of the place of a message in such an index."""

MAGIC_BYTES: Final = 8

CHANNEL_CODE, MESSAGE_CODE, CHUNK_CODE, INDEX_CODE = 0x04, 0x05, 0x06, 0x07
ATTACHMENT_CODE, METADATA_CODE, END_CODE = 0x09, 0x0C, 0x0F

MAX_RECORDS = 1_000_000
"""Maximum number of records of a file; a second of motion has about ten."""

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
    """A message: its topic, the number of its tick, its time [ns] and its content, mostly JSON."""

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


def chunk_content(chunk: Chunk) -> bytes:
    """Return the records in ``chunk``. Raises one of FAULTS, also for one that is too large."""
    if chunk.compression not in ("", "zstd"):
        raise ValueError(f"its chunks are compressed by {chunk.compression!r}, not by zstd")
    size = checked_size(chunk)
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk has {size} bytes, more than {MAX_CHUNK_BYTES}")
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


def content_at(stream: BoundedStream, offset: int) -> bytes:
    """Return the records in the chunk at ``offset``. Raises one of FAULTS."""
    chunk = next(records_at(stream, offset))
    if not isinstance(chunk, Chunk):
        raise ValueError("its chunks are wrong")
    return chunk_content(chunk)


class ChunkSpan(NamedTuple):
    """A chunk: its place in the file, its times [ns], and its number of messages by channels."""

    offset: int
    first: int
    last: int
    counts: Mapping[int, int]

    @property
    def start(self) -> float:
        """Time of its first message [s]."""
        return self.first / NANO

    @property
    def end(self) -> float:
        """Time of its last message [s]."""
        return self.last / NANO


class RecordingFile:
    """A recording, also one without an end: after a crash, or while a server writes it.

    Only the heads of records are read at first, in some milliseconds. For use in one thread.
    """

    def __init__(self, path: Path, file: BinaryIO | None = None) -> None:
        """Find the chunks of the recording at ``path``. Raises InputError.

        ``file``: it, open for reading; without it, it is opened for each read.
        """
        self.path = path
        self._file = file
        self.metadata: Mapping[str, str] = {}
        """Texts about the recording by their names."""
        self.chunks: list[ChunkSpan] = []
        """The chunks, in the order of the file."""
        self.size = 0
        """Length of the file [bytes]."""
        self.ended = False
        """Whether the file has its end."""
        self._topics: dict[int, str] = {}
        self._attachments: list[int] = []
        self._next, self._count = MAGIC_BYTES, 0
        with self._reading() as stream:
            self.size = stream.size
            # The recorder has just created a file that is empty. The others have a magic number.
            if self.size:
                next(records_at(stream, 0))
        self.update()
        if self.size and not self.metadata:
            raise InputError(f"{path} is an MCAP file, but no recording of katana450.")

    @classmethod
    @contextmanager
    def open(cls, path: Path) -> Iterator[Self]:
        """Yield the open recording at ``path``. Raises InputError if it cannot be read."""
        try:
            file = path.open("rb")
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
        with file:
            recording = cls(path, file)
            if not recording.size:
                raise InputError(f"{path} is empty: nothing was recorded.")
            recording._check_newest()
            yield recording

    @contextmanager
    def _reading(self) -> Iterator[BoundedStream]:
        with reading(self.path):
            if self._file is not None:
                yield BoundedStream(self._file)
            else:
                with self.path.open("rb") as file:
                    yield BoundedStream(file)

    def update(self) -> None:
        """Find the chunks that were added since the last call. Raises InputError."""
        if not self.ended:
            with self._reading() as stream:
                self._scan(stream)

    def _scan(self, stream: BoundedStream) -> None:
        self.size = stream.size
        while self._next + HEAD.size <= stream.size:
            stream.seek(self._next)
            code, length = HEAD.unpack(stream.read(HEAD.size))
            if code == 0 or self._next + HEAD.size + length > stream.size:
                # The rest is not written yet, or was lost in a crash.
                break
            if code == CHUNK_CODE:
                self._add_chunk(stream)
            elif code == INDEX_CODE and self.chunks:
                channel, places = INDEX.unpack(stream.read(INDEX.size))
                counts = {**self.chunks[-1].counts, channel: places // PLACE_BYTES}
                self.chunks[-1] = self.chunks[-1]._replace(counts=counts)
            elif code == METADATA_CODE:
                record = next(records_at(stream, self._next))
                if isinstance(record, Metadata) and record.name == METADATA:
                    self.metadata = dict(record.metadata)
            elif code == ATTACHMENT_CODE:
                self._attachments.append(self._next)
            elif code == END_CODE:
                self.ended = True
                return
            self._next += HEAD.size + length
            self._count += 1
            if self._count > MAX_RECORDS:
                raise ValueError(f"it has more than {MAX_RECORDS} records")

    def _add_chunk(self, stream: BoundedStream) -> None:
        first, last, size = TIMES.unpack(stream.read(TIMES.size))
        if size > MAX_CHUNK_BYTES:
            raise ValueError(f"a chunk has {size} bytes, more than {MAX_CHUNK_BYTES}")
        if not self.chunks:
            # All channels are described in the first chunk.
            self._topics = channels_in(content_at(stream, self._next))
        self.chunks.append(ChunkSpan(self._next, first, last, {}))

    def _check_newest(self) -> None:
        """Count the messages of the newest chunk, which a crash may have left without its index.

        One that was not written as a whole is left out.
        """
        if self.ended or not self.chunks:
            return
        newest = self.chunks.pop()
        with suppress(InputError), self._reading() as stream:
            messages = messages_in(content_at(stream, newest.offset), self._topics)
            topics = Counter(message.topic for message in messages)
            counts = {number: topics[topic] for number, topic in self._topics.items()}
            self.chunks.append(newest._replace(counts=counts))

    @property
    def start(self) -> float:
        """Time at which the recording begins [s]; 0 if it is empty.

        Ticks before the start of a part that was cut out serve its simulation only.
        """
        return max(min((chunk.start for chunk in self.chunks), default=0.0), self.part_start)

    @property
    def part_start(self) -> float:
        """Start of a part that was cut out of a recording [s]; -inf for a whole one."""
        try:
            return float(self.metadata.get(PART_START, "-inf"))
        except ValueError:
            return -math.inf

    @property
    def end(self) -> float:
        """Time of the last message [s]; 0 if there is none."""
        return max((chunk.end for chunk in self.chunks), default=0.0)

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
        """Seconds to add to the times of the recording for those since the epoch; 0 if unknown."""
        return utc_offset_ns(self.metadata) / NANO

    def attachments(self) -> Iterator[Attachment]:
        """Yield the files that belong to the recording. Raises InputError."""
        for offset in self._attachments:
            with self._reading() as stream:
                file = next(records_at(stream, offset))
                if not isinstance(file, McapAttachment):
                    raise ValueError("its attachments are wrong")
            yield Attachment(file.name, file.media_type, file.data, file.log_time)

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras whose pictures it may have."""
        topics = self._topics.values()
        return [topic.removeprefix(CAMERAS) for topic in topics if topic.startswith(CAMERAS)]

    def counts(self) -> dict[str, int]:
        """Return the number of messages of each topic."""
        return {
            topic: sum(chunk.counts.get(channel, 0) for chunk in self.chunks)
            for channel, topic in self._topics.items()
        }

    def messages(
        self, *topics: str, start: float = -math.inf, end: float = math.inf
    ) -> Iterator[Message]:
        """Yield the messages of ``topics`` from ``start`` to ``end`` [s], in their order.

        Raises InputError where the file is damaged.
        """
        first, last = nanoseconds_of(start), nanoseconds_of(end)
        for chunk in self.chunks:
            if chunk.last >= first and chunk.first <= last and self.has(chunk, *topics):
                for message in self.messages_of(chunk, *topics):
                    if first <= message.log_time <= last:
                        yield message

    def last_before(self, topic: str, t: float) -> Message | None:
        """Return the last message of ``topic`` at or before ``t`` [s]; None if there is none."""
        last = nanoseconds_of(t)
        for chunk in reversed(self.chunks):
            if chunk.first <= last and self.has(chunk, topic):
                for message in reversed(self.messages_of(chunk, topic)):
                    if message.log_time <= last:
                        return message
        return None

    def has(self, chunk: ChunkSpan, *topics: str) -> bool:
        """Return whether ``chunk`` has messages of ``topics``."""
        return any(count and self._topics.get(n) in topics for n, count in chunk.counts.items())

    def messages_of(self, chunk: ChunkSpan, *topics: str) -> list[Message]:
        """Return the messages of ``topics`` in ``chunk``. Raises InputError."""
        if chunk.counts and not self.has(chunk, *topics):
            # The pictures of a camera are not read for others.
            return []
        wanted = {number: topic for number, topic in self._topics.items() if topic in topics}
        with self._reading() as stream:
            return list(messages_in(content_at(stream, chunk.offset), wanted))


def utc_offset_ns(metadata: Mapping[str, str]) -> int:
    """Return the nanoseconds from times of a recording to those since the epoch; 0 if unknown."""
    text = metadata.get("utc_offset_ns", "")
    return int(text) if WHOLE.fullmatch(text) else 0


def nanoseconds_of(t: float) -> float:
    """Return the log time of ``t`` [s], which may be infinite."""
    return nanoseconds(t) if math.isfinite(t) else t
