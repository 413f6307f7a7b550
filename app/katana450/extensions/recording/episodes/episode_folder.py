"""Files of episodes, and the folder with them, which are the only truth: nothing else counts them.

Each file is a recording with exactly one episode, whose last description counts. A new description
is added to a copy of the data as it is, with a new index. That takes less time than to decode and
write all messages again.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Message as McapMessage
from mcap.summary import Summary
from msgspec.structs import replace

from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import (
    Episode,
    episode_of,
    episodes_of,
    message_of,
)
from katana450.extensions.recording.files.recording_file import (
    MAX_RECORD_BYTES,
    BoundedStream,
    Message,
    RecordingFile,
    reading,
)
from katana450.extensions.recording.files.recording_writer import (
    DATA_END_BYTES,
    FOOTER,
    MAGIC,
    packed_records,
    write_chunk,
    write_end,
)
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.folders import SUFFIX, claimed
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.messages import EPISODES, nanoseconds

SAME = 1e-3
"""[s] Largest difference of times that are the same."""


def episodes_in(file: RecordingFile) -> tuple[Episode, ...]:
    """Return all episodes that ``file`` describes, by number. Raises InputError."""
    try:
        return episodes_of(message.data for message in file.messages(EPISODES))
    except InputError as error:
        raise InputError(f"{file.path} is damaged: {error}") from error


def only_episode(file: RecordingFile) -> Episode:
    """Return the episode that ``file`` describes. Raises InputError unless there is exactly one."""
    episodes = episodes_in(file)
    if len(episodes) != 1:
        raise InputError(f"{file.path} describes {len(episodes)} episodes, not one.")
    return episodes[0]


def shown_part(file: RecordingFile, start: float | None, end: float | None) -> tuple[float, float]:
    """Return begin and end of a part of ``file``, in seconds after its start. Raises InputError.

    Each is ``start`` or ``end`` if that is given. Else it is that of the episode, which may be
    trimmed, if the file was cut out as that of one episode; else it is that of the file.
    """
    first, last = 0.0, math.inf
    episodes = episodes_in(file)
    if len(episodes) == 1 and episodes[0].end is not None and _is_cut_out(file):
        first, last = (max(t - file.start, 0.0) for t in (episodes[0].start, episodes[0].end))
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
    with RecordingFile.open(path) as file:
        before, end = only_episode(file), file.end
    if before.number != episode.number:
        raise InputError(f"{path} is of episode {before.number}, not {episode.number}.")
    text = json_text(message_of(episode, end, kind))
    append_message(path, Message(EPISODES, 0, nanoseconds(end), text))


def append_message(path: Path, message: Message) -> None:
    """Add ``message`` to the whole recording at ``path``, in one step.

    Raises InputError if the file is not a whole recording or cannot be written.
    """
    with reading(path), path.open("rb") as file:
        stream: Any = BoundedStream(file)
        summary = SeekingReader(stream, record_size_limit=MAX_RECORD_BYTES).get_summary()
        if summary is None or summary.statistics is None:
            raise InputError(f"{path} has no index, so it is not a whole recording.")
        data = _data(path, file)
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
    channel = next(entry.id for entry in summary.channels.values() if entry.topic == message.topic)
    stamp = message.log_time
    content = packed_records([McapMessage(channel, stamp, message.data, stamp, message.number)])
    write_chunk(out, summary, content, {channel: [(stamp, 0)]})
    write_end(out, summary)


NAME = re.compile(r"episode-(\d{4,9})\.(?:running\.json|mcap)")
"""Names of episode files, and of the marker of one that runs."""

DISCARDED = "discarded"
"""Name of the folder of discarded episodes."""

MARKER_SUFFIX = ".running.json"

LOCK = ".lock"

MAX_MARKER_BYTES = 100_000


@dataclass(frozen=True)
class KeptEpisode:
    """An episode with its file.

    Attributes:
        path: its file.
        episode: its description.
        start, end: first and last moment of the file [s], which bound those of the episode.
        size: length of the file [bytes].
        discarded: whether the file is in the folder of discarded ones.
    """

    path: Path
    episode: Episode
    start: float
    end: float
    size: int
    discarded: bool


class EpisodeMarker(msgspec.Struct, frozen=True):
    """An episode that runs, or ran when the process that records ended.

    Attributes:
        episode: its description so far.
        ring: folder of the ring with its ticks.
        first: name of the first file of the ring that belongs to it; empty for any.
        run: text that names the run of the server, see ``utc_offset_ns`` of a recording.
    """

    episode: Episode
    ring: Path
    first: str
    run: str


def episode_files(folder: Path) -> list[Path]:
    """Return the files of the kept episodes in ``folder``, by number."""
    files = [path for path in folder.glob(f"episode-*{SUFFIX}") if NAME.fullmatch(path.name)]
    return sorted(files, key=number_of)


def number_of(path: Path) -> int:
    """Return the number of the episode in the name of ``path``; 0 for another file."""
    match = NAME.fullmatch(path.name)
    return 0 if match is None else int(match[1])


class EpisodeFolder:
    """The episodes in a folder. One process at a time may change it, see ``claim``."""

    def __init__(self, folder: Path) -> None:
        """Use ``folder``, which need not exist."""
        self.folder = folder
        self._lock: BinaryIO | None = None
        self._known: dict[Path, tuple[tuple[int, int], KeptEpisode]] = {}

    def claim(self) -> None:
        """Create the folder, and claim it until this process ends.

        Raises InputError if another process has claimed it, or it cannot be written.
        """
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            (self.folder / DISCARDED).mkdir(mode=0o700, exist_ok=True)
            lock = open(self.folder / LOCK, "ab")  # noqa: SIM115 - open until the process ends
        except OSError as error:
            raise InputError(
                f"The folder of episodes {self.folder} cannot be written: "
                f"{error.strerror or error}. Name another one by `serve --episodes FOLDER`."
            ) from error
        if not claimed(lock):
            lock.close()
            raise InputError(
                f"Another server uses the folder of episodes {self.folder}. Name another one by "
                "`serve --episodes FOLDER`."
            )
        self._lock = lock

    def release(self) -> None:
        """End the claim."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def path(self, number: int, *, discarded: bool = False) -> Path:
        """Return the path of the file of episode ``number``."""
        folder = self.folder / DISCARDED if discarded else self.folder
        return folder / f"episode-{number:04d}{SUFFIX}"

    def kept(self) -> list[KeptEpisode]:
        """Return the kept episodes, by number. Files that cannot be read are left out."""
        return list(self._read(episode_files(self.folder), discarded=False))

    def discarded(self) -> list[KeptEpisode]:
        """Return the discarded episodes, by number. Files that cannot be read are left out."""
        return list(self._read(episode_files(self.folder / DISCARDED), discarded=True))

    def last(self) -> KeptEpisode | None:
        """Return the kept episode with the highest number; None if none can be read."""
        for path in reversed(episode_files(self.folder)):
            with suppress(InputError):
                return self._kept(path, discarded=False)
        return None

    def count(self) -> int:
        """Return the number of kept episodes."""
        return len(episode_files(self.folder))

    def unreadable(self) -> list[str]:
        """Return what is wrong with each file of an episode that cannot be read."""
        reasons = []
        for path in episode_files(self.folder):
            try:
                self._kept(path, discarded=False)
            except InputError as error:
                reasons.append(str(error))
        return reasons

    def next_number(self) -> int:
        """Return the number of the next episode, which no file has had since the last one."""
        paths = [*self.folder.glob("episode-*"), *(self.folder / DISCARDED).glob("episode-*")]
        return max(map(number_of, paths), default=0) + 1

    def find(self, number: int) -> KeptEpisode:
        """Return episode ``number``, kept or discarded. Raises InputError if there is none."""
        for discarded in (False, True):
            path = self.path(number, discarded=discarded)
            if path.exists():
                return self._kept(path, discarded=discarded)
        raise InputError(f"There is no episode {number} in {self.folder}.")

    def change(self, number: int, kind: str, **changes: Any) -> Episode:
        """Write a new description of a kept episode, with ``changes`` of its fields.

        Raises InputError if there is no such episode, or it was discarded.
        """
        before = self.find(number)
        if before.discarded:
            raise InputError(f"Episode {number} was discarded. Bring it back first.")
        episode = replace(before.episode, **changes)
        if episode != before.episode:
            with_episode(before.path, episode, kind)
        return episode

    def move(self, number: int, *, discard: bool) -> Episode:
        """Move the file of an episode to the discarded ones, or back; return the episode.

        Raises InputError.
        """
        episode = self.find(number).episode
        source, target = (self.path(number, discarded=side) for side in (not discard, discard))
        if not source.exists():
            state = "kept" if discard else "discarded"
            raise InputError(f"There is no {state} episode {number} in {self.folder}.")
        if target.exists():
            raise InputError(f"{target} exists already. Move one of the two files away.")
        try:
            target.parent.mkdir(mode=0o700, exist_ok=True)
            source.rename(target)
        except OSError as error:
            raise InputError(f"{source} cannot be moved: {error.strerror or error}.") from error
        return episode

    # The marker of an episode that runs

    def mark(self, marker: EpisodeMarker) -> None:
        """Write the marker of an episode that runs. Raises InputError."""
        text = msgspec.json.encode(marker, enc_hook=str)
        write_files({self._marker(marker.episode.number): writer_of(text)}, mode=0o600)

    def unmark(self, number: int) -> None:
        """Remove the marker of episode ``number``."""
        with suppress(OSError):
            self._marker(number).unlink()

    def markers(self) -> list[EpisodeMarker]:
        """Return the markers in the folder, by number. Wrong ones are left out."""
        markers = []
        for path in sorted(self.folder.glob(f"episode-*{MARKER_SUFFIX}")):
            with suppress(InputError, OSError):
                markers.append(_marker_in(path))
        return markers

    def _marker(self, number: int) -> Path:
        return self.folder / f"episode-{number:04d}{MARKER_SUFFIX}"

    def _read(self, paths: list[Path], *, discarded: bool) -> Iterator[KeptEpisode]:
        for path in paths:
            # It may have been moved meanwhile; ``unreadable`` reports the others.
            with suppress(InputError):
                yield self._kept(path, discarded=discarded)

    def _kept(self, path: Path, *, discarded: bool) -> KeptEpisode:
        """Return the episode in ``path``, which is read again only if the file is another one."""
        try:
            about = path.stat()
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
        version = about.st_mtime_ns, about.st_ino
        before = self._known.get(path)
        if before is not None and before[0] == version:
            return before[1]
        with RecordingFile.open(path) as file:
            episode = KeptEpisode(
                path, only_episode(file), file.start, file.end, file.size, discarded
            )
        self._known[path] = version, episode
        return episode


def _marker_in(path: Path) -> EpisodeMarker:
    if path.stat().st_size > MAX_MARKER_BYTES:
        raise InputError(f"{path} is too large for the marker of an episode.")
    try:
        # The only field that JSON has no type for is the path.
        return msgspec.json.decode(
            path.read_bytes(), type=EpisodeMarker, dec_hook=lambda _, text: Path(text)
        )
    except (msgspec.MsgspecError, UnicodeError, TypeError, RecursionError) as error:
        raise InputError(f"{path} does not describe a running episode: {error}.") from error
