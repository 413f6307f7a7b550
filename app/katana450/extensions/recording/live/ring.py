"""The ring: recordings of the last minutes, in files of about a minute each, with their events."""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from katana450.arm.control.commands.commands import RestoreState
from katana450.arm.control.lease import CommandChannel
from katana450.arm.control.state.findings import entries_between
from katana450.arm.control.state.modes import Following
from katana450.arm.control.state.state import State
from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.episodes.episode import EpisodeMessage
from katana450.extensions.recording.files.attempts import DRIVER, RESTORE
from katana450.extensions.recording.files.header import RecordingHeader
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.folders import SUFFIX, recordings_in
from katana450.extensions.recording.live.running_scripts import RunningScripts
from katana450.platform_support import create_file

MAX_FILE_TICKS = 6000
"""Ticks in a file: a minute of motion. An arm at rest has no ticks to record."""

MAX_FILES = 11
"""Number of files: the last ten minutes of motion, and the one that is being written."""

MAX_HELD_FILES = 80
"""Number of files while an episode needs older ones: an hour of motion, and some more."""

MAX_FILE_BYTES = 20_000_000
"""Size after which a file ends, without its pictures, so that the ring is bounded."""

MAX_PICTURE_BYTES = 250_000_000
"""Size of its pictures after which a file ends: those of three cameras in a minute."""

PICTURE_SECONDS = 10.0
"""[s] Time for which pictures are recorded after the last tick, unless an episode runs."""

RETRY_SECONDS = 5.0
"""[s] Time after an error of the disk until the next attempt to write."""

log = logging.getLogger(__name__)

STOP, CLEAR_STOP, STEP = "stop", "clear_stop", "step"
"""Kinds of these events, beside DRIVER and RESTORE."""


class RunEvents:
    """Finds the events of one run, tick by tick."""

    def __init__(self) -> None:
        """Begin before the first tick."""
        self._before: State | None = None
        self._driver = ""

    def of(self, record: TickRecord) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield kind and fields of each event of ``record``, the tick after the last one."""
        for command, actor in record.submissions:
            if actor is None or actor.channel is CommandChannel.SERVER or command.traits.safety:
                continue
            if actor.name != self._driver:
                self._driver = actor.name
                yield DRIVER, {"name": actor.name, "channel": actor.channel.value}
            if isinstance(command, RestoreState):
                yield RESTORE, {"recording": command.recording, "since": command.state.t}
        before, self._before = self._before, record.state
        if before is None:
            return
        yield from _stops(before, record.state)
        was, now = before.following, record.state.following
        if now is not None and now.fraction < 1.0 and _begins(was, now):
            # On the clock of the program: at its speed, and without what is done already.
            seconds = now.plan.duration_at(record.state.speed) * (1.0 - now.fraction)
            yield STEP, {"seconds": seconds}


def _begins(was: Following | None, now: Following) -> bool:
    """Return whether ``now`` is on another plan than ``was``; a later record has a copy of it."""
    return was is None or was.plan.span != now.plan.span or now.tau < was.tau


def _stops(before: State, after: State) -> Iterator[tuple[str, dict[str, Any]]]:
    was, now = before.stopped, after.stopped
    if now is not None and was is None:
        yield STOP, {"why": now.cause.why, "by": now.cause.by}
    elif now is not None and was is not None and was.cause.lacks_name_of(now.cause):
        yield STOP, {"why": now.cause.why, "by": now.cause.by, "named": True}
    elif now is None and was is not None:
        yield CLEAR_STOP, {}


class Ring:
    """Writes records into the newest file of a folder, and removes the oldest files.

    No method raises OSError. While the disk takes nothing ticks are lost, and the next file says
    how many.
    """

    def __init__(
        self,
        folder: Path,
        header: RecordingHeader,
        clock: Callable[[], float] = time.monotonic,
        scripts: RunningScripts | None = None,
    ) -> None:
        """Use ``folder``, which need not exist.

        ``scripts``: the scripts that run, whose texts are attached.
        """
        self._folder = folder
        self._header = header
        self._clock = clock
        self._path = folder
        self._file: BinaryIO | None = None
        self._writer: RecordingWriter | None = None
        self._ticks = self._picture_bytes = 0
        # Ticks that a failure of the disk would take from the present file, and those it has taken.
        self._unsynced = self._lost = 0
        self._synced_bytes = 0
        self._disk_error = ""
        self._retry_at = float("-inf")
        self._before: State | None = None
        self._newest = ""
        self._run_events = RunEvents()
        self._scripts = scripts
        # Times of the first tick, and of the first one since the last sync [s].
        self._first_t, self._unsynced_t = math.inf, math.inf
        self.lock = threading.RLock()
        """Held by each thread that uses the ring."""
        self.held: str | None = None
        """Name of the first file that an episode needs; None if none is needed."""
        self.problem = ""
        """Why the disk takes nothing now, as a sentence; empty while it does."""
        self.last_t = float("-inf")
        """Time of the newest tick [s]."""

    @property
    def unsynced(self) -> bool:
        """True if ``sync`` has something to bring to the disk."""
        return bool(self._unsynced or self._lost)

    def put_all(self, records: Sequence[TickRecord]) -> None:
        """Write the records of successive ticks, with less work than by ``put`` for each."""
        events = [self._events(record) for record in records]
        written = 0
        if self._opened():
            assert self._writer is not None
            try:
                self._writer.prepare(records)
                for record, tick_events in zip(records, events, strict=True):
                    self._writer.put(record)
                    for kind, fields in tick_events:
                        self._writer.event(record.t, kind, fields)
                    written += 1
                self._ticks += written
                self._unsynced += written
            except OSError as error:
                self._fail(error)
                written = 0
        self._lost += len(records) - written
        for record in records:
            self.last_t = record.t
            self._first_t = min(self._first_t, record.t)
            self._unsynced_t = min(self._unsynced_t, record.t)

    def put(self, record: TickRecord) -> None:
        """Write the record of a tick."""
        self.put_all([record])

    def wants_pictures(self) -> bool:
        """Return whether pictures of cameras are to be recorded now."""
        age = time.perf_counter() - self.last_t
        return self.held is not None or age < PICTURE_SECONDS

    def put_picture(self, camera: str, t: float, jpeg: bytes) -> None:
        """Write a picture of ``camera`` at ``t`` [s], a JPEG file."""
        with self.lock:
            if not self._opened():
                return
            assert self._writer is not None
            try:
                self._writer.picture(camera, t, jpeg)
            except OSError as error:
                self._fail(error)
                return
            self._picture_bytes += len(jpeg)
            if self._picture_bytes >= MAX_PICTURE_BYTES:
                # An arm at rest has no ticks, after which it would be synced.
                self.sync()

    def describe(self, t: float, content: EpisodeMessage | tuple[str, Mapping[str, Any]]) -> None:
        """Write and sync the message of an episode, or an event with its fields, at ``t`` [s]."""
        if not self._opened():
            return
        assert self._writer is not None
        try:
            if isinstance(content, tuple):
                self._writer.event(t, *content)
            else:
                self._writer.episode(t, content)
        except OSError as error:
            self._fail(error)
        self.sync()

    @property
    def newest(self) -> str:
        """Name of the newest file; empty without any."""
        return max((path.name for path in recordings_in(self._folder)), default="")

    def size_from(self, first: str) -> int:
        """Return the length [bytes] of the file ``first`` and all later ones."""
        size = 0
        for path in recordings_in(self._folder):
            if path.name >= first:
                with suppress(OSError):
                    size += path.stat().st_size
        return size

    def _events(self, record: TickRecord) -> list[tuple[str, Mapping[str, Any]]]:
        """Return the events of ``record``: also each finding that begins or ends with it."""
        if record.submissions:
            self._newest = type(record.submissions[-1].command).__name__
        before, self._before = self._before, record.state
        events: list[tuple[str, Mapping[str, Any]]] = []
        if before is not None and before.findings != record.state.findings:
            for entry in entries_between(before, record.state):
                finding = entry.finding
                fields = {
                    "reason": finding.reason.value,
                    "began": entry.began,
                    "amount": finding.amount,
                    "axis": None if finding.axis is None else finding.axis + 1,
                    "parts": None if finding.parts is None else list(finding.parts),
                    "command": self._newest,
                }
                events.append(("finding", fields))
        return [*events, *self._run_events.of(record)]

    def _note_scripts(self) -> None:
        """Attach the scripts that run, or have run since the last sync. Raises OSError."""
        if self._writer is None or self._scripts is None or self._unsynced_t > self.last_t:
            return
        for run in self._scripts.read(self.last_t):
            since, ended = run.began, run.ended
            if ended is not None and ended < self._first_t:
                continue
            for began, t in ((True, since), (False, ended)):
                if t is not None:
                    # A time without ticks is not part of the recording.
                    moment = min(max(t, self._unsynced_t), self.last_t)
                    self._writer.script(moment, run.name, run.text, since, began=began)
        self._unsynced_t = math.inf

    def lost(self, t: float, ticks: int) -> None:
        """Note that ``ticks`` ticks until ``t`` [s] never came."""
        why = "The process that records could not keep up."
        log.error("%d ticks until %.1f s were not recorded: %s", ticks, t, why)
        self.last_t = t
        if not self._opened():
            self._lost += ticks
            return
        assert self._writer is not None
        self._unsynced += ticks
        try:
            self._writer.lost(t, ticks, why)
        except OSError as error:
            self._fail(error)

    def sync(self) -> None:
        """Bring everything to the disk, and begin a new file if this one is full."""
        if self._lost:
            # To say so, also if the arm rests now.
            self._opened()
        if self._writer is None or self._file is None:
            return
        try:
            self._note_scripts()
            self._writer.flush()
            os.fsync(self._file.fileno())
            self._synced_bytes = self._file.tell()
            full = (
                self._ticks >= MAX_FILE_TICKS
                or self._picture_bytes >= MAX_PICTURE_BYTES
                or self._synced_bytes - self._picture_bytes >= MAX_FILE_BYTES
            )
            self.problem = ""
            self._unsynced = 0
        except OSError as error:
            self._fail(error)
            return
        if full:
            self.close()

    def close(self) -> None:
        """End the present file."""
        writer, file = self._writer, self._file
        if writer is None or file is None:
            return
        try:
            self._note_scripts()
            writer.close()
            os.fsync(file.fileno())
        except OSError as error:
            self._fail(error)
            return
        self._unsynced, self._writer, self._file = 0, None, None
        with suppress(OSError):
            file.close()

    def _opened(self) -> bool:
        """Begin a file if there is none; return whether there is one."""
        if self._writer is not None:
            return True
        if self._clock() < self._retry_at:
            return False
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            files = recordings_in(self._folder)
            for old in files[: -(MAX_FILES - 1)]:
                if self.held is None or old.name < self.held or old in files[:-MAX_HELD_FILES]:
                    old.unlink(missing_ok=True)
            self._synced_bytes = 0
            self._path = self._folder / f"{time.time_ns() // 1000}{SUFFIX}"
            self._file = open(create_file(self._path, 0o600), "wb")  # noqa: SIM115 - for a minute
            self._writer = RecordingWriter(self._file, self._header)
            self._ticks = self._picture_bytes = 0
            if self._lost:
                self._writer.lost(self.last_t, self._lost, self._disk_error)
            self._unsynced, self._lost = self._lost, 0
        except OSError as error:
            self._fail(error)
            return False
        return True

    def _fail(self, error: OSError) -> None:
        """End the present file after what was synced of it, which can be read."""
        log.error("The recording in %s is interrupted: %s.", self._folder, error.strerror or error)
        self._disk_error = f"The disk took nothing: {error.strerror or error}."
        self.problem = f"Nothing is recorded now: {error.strerror or error}. Free some disk space."
        self._retry_at = self._clock() + RETRY_SECONDS
        self._lost, self._unsynced = self._lost + self._unsynced, 0
        file, self._file, self._writer = self._file, None, None
        if file is None:
            return
        if not self._synced_bytes:
            self._path.unlink(missing_ok=True)
        # The rest counts as lost, and must not be there too.
        descriptor = os.dup(file.fileno())
        with suppress(OSError):
            file.close()
        with suppress(OSError):
            os.ftruncate(descriptor, self._synced_bytes)
        os.close(descriptor)
