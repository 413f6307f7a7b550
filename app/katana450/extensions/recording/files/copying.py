"""Copies of recordings, message by message."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import BinaryIO

from katana450.extensions.recording.files.header import Attachment
from katana450.extensions.recording.files.message_writer import MessageWriter
from katana450.extensions.recording.files.recording_file import Message


class RecordingCopy:
    """A new recording with messages of others."""

    def __init__(
        self, file: BinaryIO, metadata: Mapping[str, str], attachments: Iterable[Attachment]
    ) -> None:
        """Begin a recording in ``file``."""
        self._writer = MessageWriter(file, metadata, attachments)

    def add(self, message: Message) -> None:
        """Add ``message``, unless its topic is not one of recordings."""
        self._writer.add(message.topic, message.number, message.log_time, message.data)

    def flush(self) -> None:
        """End the present chunk."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and the end of the file."""
        self._writer.finish()
