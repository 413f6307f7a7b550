"""Copies of recordings, message by message."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import BinaryIO

from katana450.extensions.recording.files.header import METADATA, Attachment
from katana450.extensions.recording.files.recording_file import Message
from katana450.extensions.recording.files.recording_writer import started


class RecordingCopy:
    """A new recording with messages of others."""

    def __init__(
        self, file: BinaryIO, metadata: Mapping[str, str], attachments: Iterable[Attachment]
    ) -> None:
        """Begin a recording in ``file``."""
        self._writer, self._channels = started(file)
        self._writer.add_metadata(METADATA, dict(metadata))
        for each in attachments:
            self._writer.add_attachment(0, 0, each.name, each.media_type, each.data)

    def add(self, message: Message) -> None:
        """Add ``message``, unless its topic is not one of recordings."""
        channel = self._channels.get(message.topic)
        if channel is not None:
            at = message.log_time
            self._writer.add_message(channel, at, message.data, at, message.number)

    def flush(self) -> None:
        """End the present chunk."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and the end of the file."""
        self._writer.finish()
