"""The episode that runs, from its start to its file, also if a crash has interrupted it."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import Episode, EpisodeOutcome, message_of
from katana450.extensions.recording.episodes.episode_folder import (
    EpisodeFolder,
    EpisodeMarker,
    write_episode,
)
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import gaps_in
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live.ring import Ring
from katana450.extensions.recording.messages import STATE

NOTHING = "The arm has not moved since the server began, so there is nothing to keep."


class NothingRecordedError(InputError):
    """Raised if the ring has no state of an episode."""


def cut_out(folder: EpisodeFolder, marker: EpisodeMarker, kind: str) -> Episode:
    """Write the file of the episode of ``marker``, which may lack its end; return the episode.

    Raises NothingRecordedError if the ring has no state of it, and InputError if the ring cannot be
    found, or the file cannot be written.
    """
    if not marker.ring.is_dir():
        raise InputError(
            f"There is no folder {marker.ring}, in which its motion was recorded. Bring it back."
        )
    sources = _sources(marker)
    start, end, states = _extent(sources)
    if not states:
        raise NothingRecordedError(NOTHING)
    episode = marker.episode
    if episode.end is None:
        outcome = EpisodeOutcome.UNFINISHED
        episode = replace(episode, end=max(end, episode.start), outcome=outcome)
    episode = replace(episode, start=min(max(episode.start, start), episode.end or end))
    episode = replace(episode, missing_ticks=_missing_ticks(sources, episode))
    write_episode(sources, folder.path(episode.number), episode, kind)
    return episode


def finish_interrupted(folder: EpisodeFolder, markers: Sequence[EpisodeMarker]) -> list[str]:
    """Write the file of each episode of ``markers``, whose processes have ended.

    Returns a sentence about each. Those that cannot be written now keep their markers, for the
    next attempt.
    """
    sentences = []
    for marker in markers:
        number = marker.episode.number
        if any(folder.path(number, discarded=discarded).exists() for discarded in (False, True)):
            folder.unmark(number)
            continue
        try:
            cut_out(folder, marker, "unfinished")
        except NothingRecordedError:
            sentences.append(f"Episode {number} was interrupted before anything was recorded.")
        except InputError as error:
            sentences.append(f"Episode {number} cannot be saved: {error}")
            log.error("%s", sentences[-1])
            continue
        else:
            sentences.append(f"Episode {number} was interrupted and is kept as unfinished.")
        log.warning("%s", sentences[-1])
        folder.unmark(number)
    return sentences


def _sources(marker: EpisodeMarker) -> list[Path]:
    """Return the files of the ring with ticks of the episode of ``marker``."""
    sources = []
    for path in recordings_in(marker.ring):
        # One without a beginning, as after a crash, has nothing of it.
        with suppress(InputError), RecordingFile.open(path) as file:
            run = file.metadata.get("utc_offset_ns", "")
            if path.name >= marker.first and run == marker.run and file.chunks:
                sources.append(path)
    return sources


def _missing_ticks(sources: list[Path], episode: Episode) -> int:
    """Return the number of ticks of ``episode`` that ``sources`` state as lost."""
    assert episode.end is not None
    ticks = 0
    for path in sources:
        with RecordingFile.open(path) as file:
            ticks += sum(gap.ticks for _, gap in gaps_in(file, episode.start, episode.end))
    return ticks


def _extent(sources: list[Path]) -> tuple[float, float, int]:
    """Return the start and the end [s] of ``sources``, and the number of their states."""
    starts, ends, states = [], [], 0
    for path in sources:
        with RecordingFile.open(path) as file:
            starts.append(file.start)
            ends.append(file.end)
            states += file.counts().get(STATE, 0)
    return min(starts, default=0.0), max(ends, default=0.0), states


MAX_SECONDS = 3600.0
"""[s] Maximum length of an episode, for which the ring keeps its files."""

WARNING_SECONDS = 300.0
"""[s] Time before the maximum from which the page says how much is left."""

LATE_SECONDS = 0.5
"""[s] Time without a tick after which all ticks until the end of an episode have arrived. It is
longer than the arm's process collects them."""

MAX_WAIT = 10.0
"""[s] Maximum time for which the end of an episode waits for late ticks."""

RETRY_SECONDS = 5.0
"""[s] Time after which an episode that could not be saved is saved again."""

log = logging.getLogger(__name__)


class RunningEpisode:
    """The episode that runs, or that has ended and could not be saved yet: one at most.

    Only the state for the pages may be read in several threads at once.
    """

    def __init__(
        self,
        folder: EpisodeFolder,
        ring: Ring,
        ring_folder: Path,
        run: str,
        changed: Callable[[], None],
    ) -> None:
        """Begin without an episode.

        ``changed`` is called before one is saved. The others are those of ``EpisodeKeeper``.
        """
        # It may be finished by a program with another working directory.
        self._folder, self._ring, self._ring_folder = folder, ring, ring_folder.absolute()
        self._run, self._changed = run, changed
        self._marker: EpisodeMarker | None = None
        self._size_before = 0
        self._retry_at: float | None = None
        self._saving = False
        self._problem = ""
        self.hold_needed()

    @property
    def episode(self) -> Episode | None:
        """The episode that runs, or is not saved yet; None without any."""
        return None if self._marker is None else self._marker.episode

    @property
    def saving(self) -> int | None:
        """Number of the episode that is being saved; None without any."""
        episode = self.episode
        return episode.number if self._saving and episode is not None else None

    @property
    def problem(self) -> str:
        """Why nothing is recorded, or the episode not saved; empty if there is no problem."""
        return self._problem or ("" if self._marker is None else self._ring.problem)

    def status(self, t: float) -> dict[str, Any] | None:
        """Return the state of the episode that runs at ``t`` [s], as JSON values."""
        marker = self._marker
        if marker is None or marker.episode.end is not None:
            return None
        episode = marker.episode
        length = t - episode.start
        left = MAX_SECONDS - length
        return {
            "number": episode.number,
            "seconds": max(int(length), 0),
            "bytes": max(self._ring.size_from(marker.first) - self._size_before, 0),
            "left": max(int(left), 0) if left < WARNING_SECONDS else None,
            "by": episode.by.name,
        }

    def runs(self, number: int | None) -> bool:
        """Return whether the episode of ``number``, or for None any one, runs.

        Raises InputError for one that has ended and could not be saved yet.
        """
        episode = self.episode
        if episode is None or number not in (None, episode.number):
            return False
        if episode.end is not None:
            raise InputError(self._problem)
        return True

    def start(self, episode: Episode) -> None:
        """Begin ``episode``. Raises InputError if there is another, or nothing can be written."""
        if self.episode is not None:
            raise InputError(f"Episode {self.episode.number} runs already. End it first.")
        number, t = episode.number, episode.start
        with self._ring.lock:
            first = self._ring.newest
            marker = EpisodeMarker(episode, self._ring_folder, first, self._run)
            self._folder.mark(marker)
            self.hold_needed()
            self._size_before = self._ring.size_from(first)
            self._ring.describe(t, message_of(episode, t, "begun"))
            problem = self._ring.problem
        if problem:
            self._folder.unmark(number)
            self.hold_needed()
            raise InputError(problem)
        self._marker = marker

    def stop(self, outcome: EpisodeOutcome, t: float) -> Episode:
        """End the episode at ``t`` [s] and return it. Raises InputError if it cannot be saved."""
        marker = self._marker
        if marker is None or marker.episode.end is not None:
            raise InputError("No episode runs.")
        episode = replace(marker.episode, end=max(t, marker.episode.start), outcome=outcome)
        self._marker = replace(marker, episode=episode)
        self._saving = True
        self._changed()
        try:
            with suppress(InputError):
                # Saved at the next start with this end, if this process is killed now. A full disk
                # is reported below.
                self._folder.mark(self._marker)
            self._wait_for_ticks(t)
            with self._ring.lock:
                self._ring.describe(t, message_of(episode, t, "ended"))
            return self.save()
        finally:
            self._saving = False

    def _wait_for_ticks(self, t: float) -> None:
        """Wait until the ticks until ``t`` [s] have arrived; an arm at rest has none."""
        deadline, newest, heard = time.monotonic() + MAX_WAIT, self._ring.last_t, time.monotonic()
        while newest < t and time.monotonic() < min(deadline, heard + LATE_SECONDS):
            time.sleep(0.02)
            if self._ring.last_t != newest:
                newest, heard = self._ring.last_t, time.monotonic()

    def save(self) -> Episode:
        """Write the file of the episode that has ended; keep it for another attempt if not."""
        marker = self._marker
        assert marker is not None
        number = marker.episode.number
        try:
            with self._ring.lock:
                # What waits for the disk belongs to it.
                self._ring.sync()
                if self._ring.problem:
                    raise InputError(self._ring.problem)
            episode = cut_out(self._folder, marker, "ended")
        except NothingRecordedError:
            self._forget(number)
            raise
        except InputError as error:
            self._retry_at = time.monotonic() + RETRY_SECONDS
            self._problem = f"Episode {number} is not saved yet: {error}"
            log.error("%s", self._problem)
            raise InputError(f"{self._problem} It is tried again every few seconds.") from error
        self._forget(number)
        return episode

    def keep(self, episode: Episode) -> Episode:
        """Write the file of ``episode``, a part of the ring, and return what the ring has of it.

        Raises InputError.
        """
        with self._ring.lock:
            self._ring.sync()
        marker = EpisodeMarker(episode, self._ring_folder, "", self._run)
        return cut_out(self._folder, marker, "kept")

    @property
    def retry_due(self) -> bool:
        """True if the time has come to ``save`` again."""
        return self._retry_at is not None and time.monotonic() >= self._retry_at

    def _forget(self, number: int) -> None:
        """Release the files of the ring that episode ``number`` has needed."""
        self._folder.unmark(number)
        self._marker, self._retry_at, self._problem = None, None, ""
        self.hold_needed()

    def hold_needed(self) -> None:
        """Hold the files of the ring that this and interrupted episodes still need."""
        # Under the lock: interrupted episodes are finished in another thread.
        with self._ring.lock:
            markers = self._folder.markers()
            firsts = [marker.first for marker in markers if marker.ring == self._ring_folder]
            self._ring.held = min(firsts, default=None)
