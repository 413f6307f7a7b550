"""Files of episodes: recordings with exactly one episode, whose last description counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from katana450.errors import InputError
from katana450.extensions.recording.codec import json_text
from katana450.extensions.recording.episodes.episode import (
    Episode,
    episode_of,
    episodes_of,
    message_of,
)
from katana450.extensions.recording.files.appending import append_message
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
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
