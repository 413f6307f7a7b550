"""Files of episodes: recordings with exactly one episode, whose last description counts.

A new description is added to a copy of the data as it is, with a new index. That takes less time
than to decode and write all messages again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Message as McapMessage
from mcap.summary import Summary

from katana450.atomic import write_files
from katana450.errors import InputError
from katana450.extensions.recording.codec import json_text
from katana450.extensions.recording.episodes.episode import (
    Episode,
    episode_of,
    episodes_of,
    message_of,
)
from katana450.extensions.recording.files.message_writer import (
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
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.messages import EPISODES
from katana450.extensions.recording.state_message import nanoseconds

SAME = 1e-3
"""[s] Largest difference of times that are the same."""


def episodes_in(file: RecordingFile) -> tuple[Episode, ...]:
    """Return all episodes that ``file`` describes, by number. Raises InputError."""
    try:
        return episodes_of(message.data for message in file.messages(EPISODES))
    except InputError as error:
        raise InputError(f"{file.path} is damaged: {error}") from error


def episode_in(path: Path) -> Episode:
    """Return the episode of the file ``path``. Raises InputError unless there is exactly one."""
    with RecordingFile.open(path) as file:
        return only_episode(file)


def only_episode(file: RecordingFile) -> Episode:
    """Return the episode that ``file`` describes. Raises InputError unless there is exactly one."""
    found = episodes_in(file)
    if len(found) != 1:
        raise InputError(f"{file.path} describes {len(found)} episodes, not one.")
    return found[0]


def shown_part(file: RecordingFile, start: float | None, end: float | None) -> tuple[float, float]:
    """Return begin and end of a part of ``file``, in seconds after its start. Raises InputError.

    Each is ``start`` or ``end`` if that is given. Else it is that of the episode, which may be
    trimmed, if the file was cut out as that of one episode; else it is that of the file.
    """
    first, last = 0.0, math.inf
    found = episodes_in(file)
    if len(found) == 1 and found[0].end is not None and _is_cut_out(file):
        first, last = (max(t - file.start, 0.0) for t in (found[0].start, found[0].end))
    return first if start is None else start, last if end is None else end


def _is_cut_out(file: RecordingFile) -> bool:
    """Return whether nothing in ``file`` is outside its episode as it was first described.

    A recording of ten minutes may have one episode too, which is a part of it.
    """
    whole = episode_of(next(file.messages(EPISODES)).data)
    ended = whole.end is not None and file.end <= whole.end + SAME
    return ended and whole.start <= file.start + SAME


def write_episode(
    sources: Sequence[Path], out: Path, episode: Episode, kind: str = "ended"
) -> None:
    """Cut ``episode`` out of recordings of one run into the new file ``out``, in one step.

    Raises InputError if ``episode`` has no end, if nothing was recorded until then, or if a file
    cannot be read or written.
    """
    if episode.end is None:
        raise InputError(f"Episode {episode.number} has no end yet.")
    text = json_text(message_of(episode, episode.end, kind))
    trim(sources, out, episode.start, episode.end, text)


def with_episode(path: Path, episode: Episode, kind: str) -> None:
    """Add ``episode`` to the episode file ``path`` as its new description, in one step.

    Raises InputError if the file is of another episode, or cannot be read or written.
    """
    before = episode_in(path)
    if before.number != episode.number:
        raise InputError(f"{path} is of episode {before.number}, not {episode.number}.")
    with RecordingFile.open(path) as file:
        end = file.end
    text = json_text(message_of(episode, end, kind))
    append_message(path, Message(EPISODES, 0, nanoseconds(end), text))


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
