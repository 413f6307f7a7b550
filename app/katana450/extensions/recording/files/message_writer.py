"""Writer of messages to an MCAP file, in chunks.

Readers find the same as in a file of the writer of the ``mcap`` library, which needs more time for
a message.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment as McapAttachment
from mcap.records import (
    AttachmentIndex,
    Channel,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.summary import Summary

from katana450.cli.version import version
from katana450.extensions.recording.codec import json_text
from katana450.extensions.recording.files.header import METADATA, Attachment
from katana450.extensions.recording.files.mcap_records import (
    MAGIC,
    packed_records,
    write_chunk,
    write_end,
    write_records,
)
from katana450.extensions.recording.files.recording_file import Message
from katana450.extensions.recording.messages import TOPICS

CHUNK_BYTES = 1 << 20
"""Size before compression after which a chunk ends. ``flush`` ends one sooner."""

MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, number, and two times of a message, before its data."""


class MessageWriter:
    """Writes messages on the topics of recordings to a file. For use in one thread."""

    def __init__(
        self, file: BinaryIO, metadata: Mapping[str, str], attachments: Iterable[Attachment]
    ) -> None:
        """Begin a recording in ``file``, which is open for writing and empty."""
        self._file = file
        self._summary, self._channels = Summary(), dict[str, int]()
        self._summary.statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)
        self._index: dict[int, list[tuple[int, int]]] = {}
        file.write(MAGIC)
        write_records(file, [Header("katana450", f"katana450 {version()}")])
        for number, topic in enumerate(TOPICS, 1):
            text = json_text(topic.schema)
            self._summary.schemas[number] = Schema(number, text, "jsonschema", topic.schema_name)
            self._summary.channels[number] = Channel(number, topic.name, "json", {}, number)
            self._channels[topic.name] = number
        described = []
        for number in self._channels.values():
            described += [self._summary.schemas[number], self._summary.channels[number]]
        # In the first chunk, so that the beginning of a file alone can be read.
        self._content = bytearray(packed_records(described))
        self._add_metadata(metadata)
        statistics = self._summary.statistics
        for each in attachments:
            self.attach(each)
        statistics.schema_count = statistics.channel_count = len(TOPICS)
        statistics.metadata_count = len(self._summary.metadata_indexes)

    def _add_metadata(self, metadata: Mapping[str, str]) -> None:
        at = self._file.tell()
        length = write_records(self._file, [Metadata(METADATA, dict(metadata))])
        self._summary.metadata_indexes.append(MetadataIndex(at, length, METADATA))

    def attach(self, added: Attachment) -> None:
        """Attach a file, unless one of its name is attached."""
        found = self._summary.attachment_indexes
        at, (name, kind, data) = self._file.tell(), (added.name, added.media_type, added.data)
        if any(each.name == name for each in found):
            return
        t = added.log_time
        length = write_records(self._file, [McapAttachment(t, t, name, kind, data)])
        found.append(AttachmentIndex(at, length, t, t, len(data), name, kind))
        if self._summary.statistics is not None:
            self._summary.statistics.attachment_count = len(found)

    def add(self, topic: str, number: int, log_time: int, data: bytes) -> None:
        """Write a message; see ``recording_file.Message``. Other topics are left out."""
        channel = self._channels.get(topic)
        if channel is None:
            return
        content = self._content
        self._index.setdefault(channel, []).append((log_time, len(content)))
        length = MESSAGE.size - 9 + len(data)
        content += MESSAGE.pack(Opcode.MESSAGE, length, channel, number, log_time, log_time)
        content += data
        if len(content) > CHUNK_BYTES:
            self._end_chunk()

    def copy(self, message: Message) -> None:
        """Write ``message`` of another recording, unless its topic is not one of recordings."""
        self.add(message.topic, message.number, message.log_time, message.data)

    def _end_chunk(self) -> None:
        if self._index:
            write_chunk(self._file, self._summary, bytes(self._content), self._index)
            self._content.clear()
            self._index = {}

    def flush(self) -> None:
        """End the present chunk, and give everything to the system."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write the index and the end of the file, which stays open."""
        self._end_chunk()
        write_end(self._file, self._summary)
        self._file.flush()
