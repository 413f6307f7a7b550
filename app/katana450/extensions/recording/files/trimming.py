"""A part of a recording, or of several that follow each other, as a recording of its own.

That of a file without an end, as after a crash, has one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import BinaryIO

from katana450.atomic import write_files
from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import (
    PART_START,
    Message,
    RecordingFile,
    nanoseconds_of,
)
from katana450.extensions.recording.files.recording_writer import MessageWriter
from katana450.extensions.recording.files.script_runs import begun_before, scripts_in
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.messages import (
    CAMERAS,
    CHECKPOINTS,
    COMMANDS,
    EPISODES,
    EVENTS,
    PLANS,
    SOLIDS,
    STATE,
    nanoseconds,
)

KEY = re.compile(rb'"([0-9a-f]{32})"')
"""Pattern of the keys of shared values in messages."""

PART_TOPICS = (EVENTS, EPISODES)
"""Topics of which only the messages in the part are kept."""

CHUNK_SECONDS = 1.0
"""[s] Time after which a chunk ends, as in a recording; the index is by chunks."""


def trim(
    sources: Sequence[Path], out: Path, start: float, end: float, episode: bytes | None = None
) -> tuple[float, float]:
    """Write the part from ``start`` to ``end`` [s] of ``sources`` to ``out``; return both times.

    The sources are files of one session, which are put into the order of their times. The ticks
    from the last complete state before ``start`` on are kept too, so that the part can be simulated
    again, the texts of the scripts that ran in it, and the pictures of cameras. ``episode``:
    message on ``/episodes`` that replaces all those of the sources. Raises InputError if there is
    nothing in that time, or a file cannot be read.
    """
    with ExitStack() as stack:
        files = [stack.enter_context(RecordingFile.open(path)) for path in sources]
        files.sort(key=lambda file: file.start)
        first, last = max(start, files[0].start), min(end, max(file.end for file in files))
        if first > last or not start < end:
            raise InputError(
                f"There is nothing from {start:.3f} to {end:.3f} s; the recording is from "
                f"{files[0].start:.3f} to {files[-1].end:.3f} s."
            )
        if len({file.metadata.get("utc_offset_ns") for file in files}) > 1:
            raise InputError("The files are not of one run of the server, so their times differ.")
        begin = _checkpoint_before(files, first)
        write_files({out: lambda target: _write(target, files, (first, last), begin, episode)})
    return first, last


def keep(
    folder: Path,
    out: Path,
    last: float = math.inf,
    part: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[float, float]:
    """Write the last seconds of the ring in ``folder`` to ``out``; return their begin and end [s].

    The server may still write: of its present file, the part that is on the disk is taken. Only
    files of the newest run of the server are joined.

    Args:
        folder: folder of the ring.
        out: the new file.
        last: time before the end of the recording [s].
        part: its first and last moment [s since the epoch].

    Raises:
        InputError: the folder has no recording, or ``out`` cannot be written.
    """
    paths: list[Path] = []
    offset, end = 0.0, -math.inf
    for path in reversed(recordings_in(folder)):
        # One without a beginning, or that the server has removed meanwhile.
        with suppress(InputError), RecordingFile.open(path) as file:
            if paths and file.utc_offset != offset:
                break
            if file.chunks:
                paths.append(path)
                offset, end = file.utc_offset, max(end, file.end)
    if not paths:
        raise InputError(
            f"{folder} has no recording. A server names its folder at the start; nothing is "
            "recorded while the arm rests."
        )
    start, stop = (t - offset for t in part)
    return trim(paths, out, max(end - last, start), min(end, stop))


def _checkpoint_before(files: Sequence[RecordingFile], t: float) -> float | None:
    """Return the time of the last checkpoint at or before ``t`` [s], or else of the first."""
    for file in reversed(files):
        checkpoint = file.last_before(CHECKPOINTS, t)
        if checkpoint is not None:
            return checkpoint.t
    return next((message.t for file in files for message in file.messages(CHECKPOINTS)), None)


def _write(
    target: BinaryIO,
    files: Sequence[RecordingFile],
    part: tuple[float, float],
    begin: float | None,
    episode: bytes | None,
) -> None:
    start, end = part
    metadata = {**files[0].metadata, PART_START: repr(start)}
    attachments, runs = scripts_in(files, start, end)
    cameras = sorted({name for file in files for name in file.cameras})
    copy = MessageWriter(target, metadata, attachments, cameras)
    needed: set[bytes] = set()
    for message in _simulated(files, (COMMANDS, CHECKPOINTS), begin, end):
        needed.update(KEY.findall(message.data))
    written: set[bytes] = set()
    for file in files:
        for message in file.messages(PLANS, SOLIDS, end=end):
            key = KEY.search(message.data)
            if key is not None and key[1] in needed - written:
                written.add(key[1])
                copy.copy(message)
    copy.flush()
    chunk_ends = start
    if episode is not None:
        # The part begins with it, although an arm at rest may have no states until later.
        copy.copy(Message(EPISODES, 0, nanoseconds(start), episode))
    for run in runs:
        if run.start < start:
            copy.copy(Message(EVENTS, 0, nanoseconds(start), begun_before(run, start)))
    number = 0
    topics = COMMANDS, CHECKPOINTS, STATE, *PART_TOPICS
    for message in _simulated(files, topics, start if begin is None else min(begin, start), end):
        if message.topic in PART_TOPICS and message.log_time < nanoseconds_of(start):
            continue
        number = message.number
        if episode is None or message.topic != EPISODES:
            copy.copy(message)
        if message.t >= chunk_ends:
            copy.flush()
            chunk_ends = message.t + CHUNK_SECONDS
    if episode is not None:
        # In a chunk of its own, which is found at once.
        copy.flush()
        copy.copy(Message(EPISODES, number, nanoseconds(end), episode))
    for file in files:
        for message in file.messages(*(CAMERAS + name for name in cameras), start=start, end=end):
            copy.copy(message)
    copy.finish()


def _simulated(
    files: Sequence[RecordingFile], topics: Sequence[str], begin: float | None, end: float
) -> Iterator[Message]:
    """Yield the messages of ``topics`` from ``begin`` to ``end`` [s], in the order of ``files``.

    Ticks before the first complete state are left out, as they cannot be simulated. Without
    ``begin`` there are none.
    """
    if begin is None:
        return
    started = False
    for file in files:
        for message in file.messages(*topics, start=begin, end=end):
            started |= message.topic == CHECKPOINTS
            if started or message.topic != COMMANDS:
                yield message
