"""One run of a server as it was recorded, in one file or in the files of a ring."""

from __future__ import annotations

import threading
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from msgspec import structs

from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.recording.files.attempts import (
    Attempt,
    TreeEvent,
    tree_events,
    tree_of,
)
from katana450.extensions.recording.files.pictures import jpeg_of
from katana450.extensions.recording.files.recording_file import ChunkSpan, Message, RecordingFile
from katana450.extensions.recording.files.simulation import (
    TickReader,
    content_of,
    recorded_input,
)
from katana450.extensions.recording.files.spans import Span, spans_of
from katana450.extensions.recording.messages import (
    CAMERAS,
    CHECKPOINTS,
    EPISODES,
    EVENTS,
    SOLIDS,
    STATE,
    StateRow,
    TickMessage,
)
from katana450.extensions.recording.playback.marks import Mark, add_marks
from katana450.extensions.recording.playback.rows import (
    Block,
    Description,
    RecordedMoment,
    description,
)
from katana450.extensions.recording.ticks import TickInput

MAX_BLOCKS = 120
"""Number of decoded blocks that are kept, 4 min of motion; each has about 0.2 MB."""

MAX_BLOCK_BYTES = 32_000_000
"""Maximum memory of the states of a block [bytes]; one of 2 s of motion takes about 0.4 MB."""

STATE_BYTES = 1000
"""Memory of a state besides its message [bytes]."""

PICTURE_SECONDS = 0.5
"""[s] Time for which a picture of a camera is shown."""

MAX_SOLID_BYTES = 128_000_000
"""Maximum size of the solids of a file [bytes]."""

MAX_MARKS = 400
"""Number of marks of a timeline, and of events of its tree; the newest are kept."""

MAX_ROWS = 1000
"""Number of states of which a part is measured."""


class _File:
    """One file, and what was read of it."""

    def __init__(self, path: Path) -> None:
        self.index = RecordingFile(path)
        self.reader = TickReader()
        self.marked = 0
        self.marks: list[Mark] = []
        self.events: list[TreeEvent] = []
        self.starts: list[int] = []
        """The numbers of the chunks with a complete state."""
        self._searched = 0
        self._solid_bytes = 0

    @property
    def chunks(self) -> list[ChunkSpan]:
        return self.index.chunks

    def update(self) -> None:
        """Read what was added to the file. Raises InputError."""
        self.index.update()
        # The index of the newest chunk may still be missing.
        while self._searched < len(self.chunks) and self.chunks[self._searched].counts:
            chunk = self.chunks[self._searched]
            if self.index.has(chunk, CHECKPOINTS):
                self.starts.append(self._searched)
            if self.index.has(chunk, SOLIDS):
                for message in self.index.messages_of(chunk, SOLIDS):
                    self._solid_bytes += len(message.data)
                    if self._solid_bytes > MAX_SOLID_BYTES:
                        raise InputError(
                            f"The shapes in the recording have more than {MAX_SOLID_BYTES} bytes."
                        )
                    self.reader.add_shared(message)
            self._searched += 1


class _Place(NamedTuple):
    """A block: its file, and the numbers of its first chunk and of the one after it."""

    file: _File
    first: int
    last: int


class PlaybackRun:
    """The newest run in some files. For any thread; times are seconds since the epoch."""

    def __init__(self, paths: Callable[[], Sequence[Path]]) -> None:
        """Read files as they come. ``paths`` returns the files, the oldest first."""
        self._paths = paths
        self._files: list[_File] = []
        self._blocks: OrderedDict[tuple[Path, int, int], Block] = OrderedDict()
        self._lock = threading.Lock()
        self._offset = 0.0
        self.metadata: Mapping[str, str] = {}
        """Texts about the newest file."""

    def update(self) -> None:
        """Read what was added. Raises InputError if there is nothing that can be read."""
        with self._lock:
            known = {known_file.index.path: known_file for known_file in self._files}
            files: list[_File] = []
            problem: InputError | None = None
            for path in reversed(self._paths()):
                try:
                    file = known.get(path) or _File(path)
                    file.update()
                except InputError as error:
                    problem = error
                    continue
                if not file.chunks:
                    continue
                if files and file.index.utc_offset != files[0].index.utc_offset:
                    break
                files.append(file)
            self._files = files[::-1]
            if files:
                self._offset, self.metadata = files[0].index.utc_offset, files[0].index.metadata
            elif problem is not None:
                raise problem

    @property
    def spans(self) -> tuple[Span, ...]:
        """The times with records."""
        shift = self._offset
        return spans_of(
            (max(chunk.start, file.index.part_start) + shift, chunk.end + shift)
            for file in self._files
            for chunk in file.chunks
            if chunk.end >= file.index.part_start
        )

    def marks(self) -> list[Mark]:
        """Return the newest marks in their order. Raises InputError for a damaged file."""
        with self._lock:
            marks = [mark for file in self._files for mark in self._marks(file)]
            # What follows from scripts and names is written later than it happens.
            marks.sort(key=lambda mark: mark.t)
            shift = self._offset
            return [mark._replace(t=mark.t + shift) for mark in marks[-MAX_MARKS:]]

    def attempts(self) -> list[Attempt]:
        """Return the tree of attempts. Raises InputError for a damaged file."""
        # The marks are read with the events.
        self.marks()
        with self._lock:
            shift, spans = self._offset, self.spans
            events = [
                structs.replace(event, t=event.t + shift, since=event.since + shift)
                for file in self._files
                for event in file.events
            ]
            return tree_of(events, spans[0].start, spans[-1].end) if spans else []

    def rows(self, spans: Sequence[tuple[float, float]]) -> list[StateRow]:
        """Return states in ``spans`` [s], in equal steps if there are more than MAX_ROWS.

        Raises InputError for a damaged file.
        """
        with self._lock:
            messages = [
                message
                for start, end in spans
                for file in self._files
                for message in file.index.messages(
                    STATE, start=start - self._offset, end=end - self._offset
                )
            ]
            step = -(-len(messages) // MAX_ROWS) or 1
            return [content_of(message, StateRow) for message in messages[::step]]

    def at(self, t: float) -> RecordedMoment | None:
        """Return the state at ``t`` [s], or the first one after it; None without states.

        Raises InputError for a damaged file.
        """
        with self._lock:
            first: Block | None = None
            for place in self._places(t - self._offset):
                block = self._block(place)
                moment = block.at(t - self._offset)
                if moment is not None:
                    return moment
                first = block
            return None if first is None else first.at(first.start)

    def input_until(self, t: float) -> list[State | TickInput | TickMessage]:
        """Return what the state at ``t`` [s] is simulated from, as ``state_after`` takes it.

        Raises InputError for a damaged file, and before the first complete state.
        """
        with self._lock:
            t -= self._offset
            for file in reversed(self._files):
                if file.index.last_before(CHECKPOINTS, t) is not None:
                    return list(recorded_input(file.index, t, t))
        raise InputError("Nothing complete is recorded before this moment. Choose a later one.")

    def picture(self, camera: str, t: float) -> bytes | None:
        """Return the last picture of ``camera`` at or before ``t`` [s], a JPEG file; None without.

        Raises InputError for a damaged file.
        """
        t -= self._offset
        with self._lock:
            for file in reversed(self._files):
                message = file.index.last_before(CAMERAS + camera, t)
                if message is not None:
                    return jpeg_of(message) if t - message.t < PICTURE_SECONDS else None
        return None

    def _places(self, t: float) -> Iterator[_Place]:
        """Yield the blocks in which the state at ``t`` [s] of the files' clock may be."""
        for file in reversed(self._files):
            starts = file.starts
            after = bisect_right(starts, t, key=lambda number: file.chunks[number].start)
            # The complete state of the last of these chunks may be after the time.
            for number in range(after - 1, max(after - 3, -1), -1):
                last = starts[number + 1] if number + 1 < len(starts) else len(file.chunks) - 1
                yield _Place(file, starts[number], last)
        oldest = self._files[0] if self._files else None
        if oldest is not None and oldest.chunks:
            yield _Place(oldest, 0, len(oldest.chunks[:2]) - 1)

    def _block(self, place: _Place) -> Block:
        index = place.file.index
        key = (index.path, index.chunks[place.first].offset, index.chunks[place.last].offset)
        known = self._blocks.get(key)
        if known is None:
            known = self._blocks[key] = self._read(place)
            while len(self._blocks) > MAX_BLOCKS:
                self._blocks.popitem(last=False)
        self._blocks.move_to_end(key)
        return known

    def _read(self, place: _Place) -> Block:
        """Decode a block: from the first complete state in its first chunk to that in its last."""
        file, states = place.file, list[Message]()
        descriptions: list[Description] = []
        for number in range(place.first, place.last + 1):
            messages = file.index.messages_of(file.chunks[number], STATE, CHECKPOINTS)
            complete = [message for message in messages if message.topic == CHECKPOINTS]
            descriptions += (description(file.reader, message) for message in complete)
            first = complete[0].number if complete else None
            for message in messages:
                if message.topic != STATE:
                    continue
                before = first is not None and message.number < first
                if number == place.first and before:
                    continue
                if number > place.first and first is not None and not before:
                    break
                states.append(message)
            if sum(STATE_BYTES + len(message.data) for message in states) > MAX_BLOCK_BYTES:
                raise InputError(
                    f"The recording has more than {MAX_BLOCK_BYTES} bytes between two complete "
                    "states."
                )
        return Block(states, descriptions)

    def _marks(self, file: _File) -> list[Mark]:
        while file.marked < len(file.chunks) and file.chunks[file.marked].counts:
            chunk = file.chunks[file.marked]
            file.marked += 1
            if file.index.has(chunk, EVENTS, EPISODES):
                messages = file.index.messages_of(chunk, EVENTS, EPISODES)
                add_marks(file.marks, messages)
                file.events += tree_events(messages)
                del file.marks[:-MAX_MARKS], file.events[:-MAX_MARKS]
        return file.marks
