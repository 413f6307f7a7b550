"""Writers of recordings: MCAP files with JSON messages, in chunks with their indexes.

A message is on the disk after ``flush`` and ``os.fsync`` of the file, which the caller does about
once a second. What was synced before a crash can be read.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment as McapAttachment
from mcap.records import (
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.summary import Summary

from katana450.arm.control.state.state import State
from katana450.arm.runtime.tick import TickRecord
from katana450.cli.version import version
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.episodes.episode import EpisodeMessage
from katana450.extensions.recording.files.header import METADATA, Attachment, RecordingHeader
from katana450.extensions.recording.files.pictures import (
    ENCODING,
    SCHEMA,
    SCHEMA_ENCODING,
    SCHEMA_NAME,
    picture_message,
)
from katana450.extensions.recording.files.recording_file import Message
from katana450.extensions.recording.files.script_runs import (
    PROGRAM,
    ProgramEvent,
    attached_script,
    sha256,
)
from katana450.extensions.recording.forms import FormError, json_text
from katana450.extensions.recording.messages import (
    CAMERAS,
    CHECKPOINTS,
    COMMANDS,
    EPISODES,
    EVENTS,
    SHARED_TOPICS,
    STATE,
    TOPICS,
    CheckpointMessage,
    StateMessages,
    TickMessage,
    nanoseconds,
)
from katana450.extensions.recording.ticks import Digester, tick_message, without_identities

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
    for record in records:
        record.write(builder)
    return bytes(builder.end())


def write_chunk(
    out: BinaryIO, summary: Summary, content: bytes, index: Index, *, packs: bool = True
) -> None:
    """Write a chunk with the records ``content``, and add it to ``summary``.

    ``index``: the messages in it, of which there is at least one. ``packs``: whether to compress.
    """
    times = [t for places in index.values() for t, _ in places]
    first, last = min(times), max(times)
    compression, packed = "", content
    if packs:
        compression = "zstd"
        packed = zstandard.ZstdCompressor(compression_params=PACKING).compress(content)
    start = out.tell()
    chunk = Chunk(compression, packed, last, first, zlib.crc32(content), len(content))
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
            compression=compression,
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


CHUNK_BYTES = 1 << 20
"""Size before compression after which a chunk ends. ``flush`` ends one sooner."""

MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, number, and two times of a message, before its data."""


class ChunkBuffer:
    """The messages of the next chunk, and the places of these."""

    def __init__(self) -> None:
        """Begin without messages."""
        self.content = bytearray()
        self.index: dict[int, list[tuple[int, int]]] = {}

    def add(self, channel: int, number: int, log_time: int, data: bytes) -> None:
        """Add a message; see ``recording_file.Message``."""
        self.index.setdefault(channel, []).append((log_time, len(self.content)))
        length = MESSAGE.size - 9 + len(data)
        self.content += MESSAGE.pack(Opcode.MESSAGE, length, channel, number, log_time, log_time)
        self.content += data


class MessageWriter:
    """Writes messages on the topics of recordings to a file. For use in one thread.

    Pictures are in chunks of their own, which are not compressed, so that states are read without
    them.
    """

    def __init__(
        self,
        file: BinaryIO,
        metadata: Mapping[str, str],
        attachments: Iterable[Attachment],
        cameras: Collection[str] = (),
    ) -> None:
        """Begin a recording in ``file``, which is open for writing and empty.

        ``cameras``: names of the cameras whose pictures it may have.
        """
        self._file = file
        self._summary, self._channels = Summary(), dict[str, int]()
        self._summary.statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)
        file.write(MAGIC)
        write_records(file, [Header("katana450", f"katana450 {version()}")])
        for number, topic in enumerate(TOPICS, 1):
            text = json_text(topic.schema)
            self._summary.schemas[number] = Schema(number, text, "jsonschema", topic.schema_name)
            self._summary.channels[number] = Channel(number, topic.name, "json", {}, number)
            self._channels[topic.name] = number
        schema = len(TOPICS) + 1
        if cameras:
            definition = SCHEMA.encode()
            self._summary.schemas[schema] = Schema(schema, definition, SCHEMA_ENCODING, SCHEMA_NAME)
        for number, name in enumerate(cameras, schema):
            self._channels[CAMERAS + name] = number
            self._summary.channels[number] = Channel(number, CAMERAS + name, ENCODING, {}, schema)
        self._messages, self._pictures = ChunkBuffer(), ChunkBuffer()
        # In the first chunk, so that the beginning of a file alone can be read.
        described = [*self._summary.schemas.values(), *self._summary.channels.values()]
        self._messages.content += packed_records(described)
        self._add_metadata(metadata)
        statistics = self._summary.statistics
        for attachment in attachments:
            self.attach(attachment)
        statistics.schema_count = len(self._summary.schemas)
        statistics.channel_count = len(self._summary.channels)
        statistics.metadata_count = len(self._summary.metadata_indexes)

    def _add_metadata(self, metadata: Mapping[str, str]) -> None:
        offset = self._file.tell()
        length = write_records(self._file, [Metadata(METADATA, dict(metadata))])
        self._summary.metadata_indexes.append(MetadataIndex(offset, length, METADATA))

    def attach(self, added: Attachment) -> None:
        """Attach a file, unless one of its name is attached."""
        indexes = self._summary.attachment_indexes
        offset, (name, kind, data) = self._file.tell(), (added.name, added.media_type, added.data)
        if any(index.name == name for index in indexes):
            return
        t = added.log_time
        length = write_records(self._file, [McapAttachment(t, t, name, kind, data)])
        indexes.append(AttachmentIndex(offset, length, t, t, len(data), name, kind))
        if self._summary.statistics is not None:
            self._summary.statistics.attachment_count = len(indexes)

    def add(self, topic: str, number: int, log_time: int, data: bytes) -> None:
        """Write a message; see ``recording_file.Message``. Other topics are left out."""
        channel = self._channels.get(topic)
        if channel is None:
            return
        # The first chunk describes the channels, whatever else is in it.
        is_apart = topic.startswith(CAMERAS) and bool(self._summary.chunk_indexes)
        buffer = self._pictures if is_apart else self._messages
        buffer.add(channel, number, log_time, data)
        if len(buffer.content) > CHUNK_BYTES:
            self._end_chunk(buffer)

    def copy(self, message: Message) -> None:
        """Write ``message`` of another recording, unless its topic is not one of recordings."""
        self.add(message.topic, message.number, message.log_time, message.data)

    def _end_chunk(self, buffer: ChunkBuffer) -> None:
        if buffer.index:
            packs = buffer is self._messages
            content = bytes(buffer.content)
            write_chunk(self._file, self._summary, content, buffer.index, packs=packs)
            buffer.content.clear()
            buffer.index = {}

    def flush(self) -> None:
        """End the present chunks, and give everything to the system."""
        self._end_chunk(self._messages)
        self._end_chunk(self._pictures)
        self._file.flush()

    def finish(self) -> None:
        """Write the index and the end of the file, which stays open."""
        self.flush()
        write_end(self._file, self._summary)
        self._file.flush()


CHECKPOINT_PERIOD = 2.0
"""[s] Time between two complete states: a simulation from one to any moment takes 0.2 s."""


class RecordingWriter:
    """Writes the ticks of one session to a file. For use in one thread.

    Every method may raise OSError. The file then has no end.
    """

    def __init__(self, file: BinaryIO, header: RecordingHeader) -> None:
        """Begin a recording in ``file``, which is open for writing and empty."""
        self._writer = MessageWriter(file, header.metadata, header.attachments, header.cameras)
        self._codec, self._digester = Codec(), Digester()
        self._messages = StateMessages(header.robot, header.environment)
        self._number = 0
        # Content and time of the newest state, and time of the newest complete one [s].
        self._content = b""
        self._t: float | None = None
        self._checkpoint_t: float | None = None
        self._scripts: set[tuple[str, float, bool]] = set()
        file.flush()

    def prepare(self, records: Sequence[TickRecord]) -> None:
        """Do what takes less time for several ticks together. ``put`` must follow for each."""
        self._messages.prepare([record.state for record in records])

    def put(self, record: TickRecord) -> None:
        """Write one tick. Its records must come in the order of the ticks, without gaps.

        A tick with a value that has no form is written as missing, with the reason.
        """
        record = without_identities(record)
        state, t = record.state, record.t
        self._number += 1
        try:
            content = self._digester.content(state)
            digest = self._digester.digest(state, content)
            form = tick_message(self._codec, record, self._t, digest)
        except FormError as error:
            self._checkpoint_t = self._t = None
            self._add(COMMANDS, t, TickMessage(t, missing=str(error)))
            return
        self._add_shared(t)
        self._add(COMMANDS, t, form)
        self._t = state.t
        due = self._checkpoint_t is None or t - self._checkpoint_t >= CHECKPOINT_PERIOD
        if due:
            self._messages.describe_all()
        if due or content != self._content:
            self._content = content
            self._add(STATE, t, self._messages.state(state))
        if due:
            self._add_checkpoint(t, state)

    def lost(self, t: float, ticks: int, why: str) -> None:
        """Record that ``ticks`` ticks until ``t`` [s] were lost, for the reason ``why``."""
        self._number += ticks
        self._checkpoint_t = self._t = None
        self._add(COMMANDS, t, TickMessage(t, missing=why, ticks=ticks))

    def event(self, t: float, kind: str, what: Mapping[str, Any]) -> None:
        """Record an event at ``t`` [s] with further fields, which are JSON values."""
        self._add(EVENTS, t, {"t": t, "kind": kind, **what})

    def script(self, t: float, name: str, text: str, since: float, *, began: bool) -> None:
        """Record at ``t`` [s] that a script began or ended, and attach its text once.

        ``since``: the time at which it began [s], maybe before the file.
        """
        script = attached_script(name, text, since)
        if (script.name, since, began) not in self._scripts:
            self._scripts.add((script.name, since, began))
            self._writer.attach(script)
            digest = sha256(script.data)
            event = ProgramEvent(t, PROGRAM, began, name, script.name, digest, since)
            self._add(EVENTS, t, event)

    def episode(self, t: float, message: EpisodeMessage) -> None:
        """Record the description of an episode at ``t`` [s]; see ``episodes.episode``."""
        self._add(EPISODES, t, message)

    def picture(self, camera: str, t: float, jpeg: bytes) -> None:
        """Record a picture of ``camera`` at ``t`` [s], a JPEG file."""
        self._writer.copy(picture_message(camera, max(nanoseconds(t), 0), jpeg))

    def flush(self) -> None:
        """Give everything to the system. ``os.fsync`` of the file then brings it to the disk."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and the end of the file. The file itself stays open."""
        self._writer.finish()

    def _add(self, topic: str, t: float, form: Any) -> None:
        self._writer.add(topic, self._number, max(nanoseconds(t), 0), json_text(form))

    def _add_shared(self, t: float) -> None:
        log_time = max(nanoseconds(t), 0)
        for kind, key, text in self._codec.shared.take_new():
            # The key is that of these bytes, so they are written as they are.
            data = b'{"key":"%b","value":%b}' % (key.encode(), text)
            self._writer.add(SHARED_TOPICS[kind], self._number, log_time, data)

    def _add_checkpoint(self, t: float, state: State) -> None:
        try:
            form = self._codec.encoded(state)
        except FormError:
            # A value without a form, whose tick was written as missing. A later state may do.
            return
        self._add_shared(t)
        self._add(CHECKPOINTS, t, CheckpointMessage(t, form))
        self._checkpoint_t = t
