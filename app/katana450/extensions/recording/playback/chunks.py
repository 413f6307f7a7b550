"""Index of the chunks of a recording, also of one that a server is still writing.

Only the heads of records are read, so that the end of a growing file is found in a millisecond.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from mcap.records import Metadata

from katana450.extensions.recording.files.header import METADATA
from katana450.extensions.recording.files.recording_file import (
    HEAD,
    BoundedStream,
    Message,
    channels_in,
    content_at,
    messages_at,
    part_start_of,
    reading,
    records_at,
    utc_offset_of,
)
from katana450.extensions.recording.messages import NANO

MAX_UNPACKED = 16_000_000
"""Maximum size of an unpacked chunk [bytes]; one holds a second of motion, half a megabyte."""

MAX_RECORDS = 1_000_000
"""Maximum number of records of a file; a second of motion has about ten."""

MAGIC_BYTES: Final = 8
TIMES: Final = struct.Struct("<QQQ")
"""Start of a chunk: its first and last time [ns], and its unpacked size [bytes]."""
CHANNEL: Final = struct.Struct("<H")

METADATA_CODE, CHUNK_CODE, INDEX_CODE, END_CODE = 0x0C, 0x06, 0x07, 0x0F


class ChunkSpan(NamedTuple):
    """A chunk: its place in the file, its times [s], and the channels of its messages."""

    offset: int
    start: float
    end: float
    channels: frozenset[int]


class ChunkIndex:
    """The whole chunks of one file. For use by one thread at a time."""

    def __init__(self, path: Path) -> None:
        """Read the index of the recording at ``path``. Raises InputError."""
        self.path = path
        self.metadata: dict[str, str] = {}
        """Texts about the recording by their names."""
        self.chunks: list[ChunkSpan] = []
        """The chunks, in the order of the file."""
        self._topics: dict[int, str] = {}
        self._next, self._count = MAGIC_BYTES, 0
        self._ended = False
        self.update()

    @property
    def utc_offset(self) -> float:
        """Seconds to add to the times of the recording for seconds since the epoch."""
        return utc_offset_of(self.metadata)

    @property
    def part_start(self) -> float:
        """Time at which a part begins that was cut out [s]; what is before serves simulation."""
        return part_start_of(self.metadata)

    def update(self) -> None:
        """Find the chunks that were added since the last call. Raises InputError."""
        if self._ended:
            return
        with reading(self.path), self.path.open("rb") as file:
            self._scan(file)

    def has(self, chunk: ChunkSpan, topic: str) -> bool:
        """Return whether ``chunk`` has messages of ``topic``."""
        return any(self._topics.get(channel) == topic for channel in chunk.channels)

    def messages(self, chunk: ChunkSpan, *topics: str) -> list[Message]:
        """Return the messages of ``topics`` in ``chunk``. Raises InputError."""
        with reading(self.path), self.path.open("rb") as file:
            stream = BoundedStream(file)
            return messages_at(stream, chunk.offset, self._topics, topics, MAX_UNPACKED)

    def _scan(self, file: BinaryIO) -> None:
        stream = BoundedStream(file)
        if self._next == MAGIC_BYTES and stream.size >= MAGIC_BYTES:
            # This checks the magic number too.
            next(records_at(stream, 0), None)
        while self._next + HEAD.size <= stream.size:
            file.seek(self._next)
            code, length = HEAD.unpack(file.read(HEAD.size))
            if self._next + HEAD.size + length > stream.size:
                # The rest is not written yet.
                break
            if code == CHUNK_CODE:
                self._add_chunk(file, stream)
            elif code == INDEX_CODE and self.chunks:
                last = self.chunks[-1]
                channels = last.channels | set(CHANNEL.unpack(file.read(CHANNEL.size)))
                self.chunks[-1] = last._replace(channels=channels)
            elif code == METADATA_CODE:
                self._add_metadata(stream)
            elif code == END_CODE:
                self._ended = True
                return
            self._next += HEAD.size + length
            self._count += 1
            if self._count > MAX_RECORDS:
                raise ValueError(f"it has more than {MAX_RECORDS} records")

    def _add_chunk(self, file: BinaryIO, stream: BoundedStream) -> None:
        first, last, size = TIMES.unpack(file.read(TIMES.size))
        if size > MAX_UNPACKED:
            raise ValueError(f"a chunk has {size} bytes, more than {MAX_UNPACKED}")
        if not self.chunks:
            # All channels are described in the first chunk.
            self._topics = channels_in(content_at(stream, self._next, MAX_UNPACKED))
        self.chunks.append(ChunkSpan(self._next, first / NANO, last / NANO, frozenset()))

    def _add_metadata(self, stream: BoundedStream) -> None:
        record = next(records_at(stream, self._next))
        if isinstance(record, Metadata) and record.name == METADATA:
            self.metadata = dict(record.metadata)
