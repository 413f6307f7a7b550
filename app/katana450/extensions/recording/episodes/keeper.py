"""Episodes in the process that records: begun, ended, judged and kept in their folder.

Requests come one after another, each in the thread of its connection. The state for the pages is
read meanwhile.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import (
    Episode,
    EpisodeGiver,
    EpisodeOutcome,
    message_of,
)
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder, EpisodeMarker
from katana450.extensions.recording.episodes.episode_requests import (
    DescribeEpisode,
    DiscardEpisode,
    EpisodeRequest,
    JudgeEpisode,
    RerecordEpisode,
    RestoreEpisode,
    StartEpisode,
    StopEpisode,
    TrimEpisode,
    UndoEpisode,
)
from katana450.extensions.recording.episodes.interrupted import (
    NothingRecordedError,
    cut_out,
    finish_interrupted,
)
from katana450.extensions.recording.episodes.undoable_judgement import (
    UNDO_SECONDS,
    UndoableJudgement,
)
from katana450.extensions.recording.live.ring import Ring

MAX_SECONDS = 3600.0
"""[s] Maximum length of an episode, for which the ring keeps its files."""

WARNING_SECONDS = 300.0
"""[s] Time before the maximum from which the page says how much is left."""

LATE_SECONDS = 0.3
"""[s] Time without a tick after which all ticks until the end of an episode have arrived."""

MAX_WAIT = 10.0
"""[s] Maximum time for which the end of an episode waits for late ticks."""

RETRY_SECONDS = 5.0
"""[s] Time after which an episode that could not be saved is saved again."""

log = logging.getLogger(__name__)


class EpisodeKeeper:
    """Keeps the episodes of one server. Every method may be called in any thread."""

    def __init__(
        self,
        folder: EpisodeFolder,
        ring: Ring,
        ring_folder: Path,
        run: str,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Use ``folder``, which is claimed. Episodes that a crash interrupted are finished.

        Args:
            folder: the folder of episodes.
            ring: the ring that is written in this process.
            ring_folder: its folder.
            run: text that names this run of the server, as in the metadata of its recordings.
            clock: the clock of the recording [s].
        """
        self._folder, self._ring, self._ring_folder = folder, ring, ring_folder
        self._run, self._clock = run, clock
        self._requests = threading.Lock()
        self._changed = threading.Condition()
        self._marker: EpisodeMarker | None = None
        self._size_before = 0
        self._unsaved = False
        self._retry_at = float("inf")
        self._saving = False
        self._undoable: UndoableJudgement | None = None
        self._notice = ""
        self._problem = ""
        self._revision = 0
        for said in finish_interrupted(folder):
            self._notice = said
        last = folder.last()
        self._task = "" if last is None else last.episode.task
        self._hold_interrupted()

    # The state for the pages

    @property
    def revision(self) -> int:
        """Number that changes with every change of the state."""
        return self._revision

    def wait(self, revision: int, seconds: float) -> int:
        """Wait up to ``seconds`` until ``revision`` is old; return the present one."""
        with self._changed:
            self._changed.wait_for(lambda: self._revision != revision, seconds)
            return self._revision

    @property
    def active(self) -> bool:
        """True if the state changes by itself, because an episode runs or can be undone."""
        return self._marker is not None or self._undo() is not None

    def status(self) -> dict[str, Any]:
        """Return the state as JSON values."""
        marker, undo = self._marker, self._undo()
        now = self._clock()
        status: dict[str, Any] = {
            "revision": self._revision,
            "running": None,
            "saving": self._saving,
            "count": self._folder.count(),
            "task": self._task,
            "last": self._last_kept(),
            "undo": None
            if undo is None
            else {"number": undo.number, "discarded": undo.before is None},
            "problem": self._problem or (self._ring.problem if marker is not None else ""),
            "notice": self._notice,
        }
        if marker is not None and marker.episode.end is None:
            episode = marker.episode
            length = now - episode.begin
            left = MAX_SECONDS - length
            status["running"] = {
                "number": episode.number,
                "seconds": max(int(length), 0),
                "bytes": max(self._ring.size_from(marker.first) - self._size_before, 0),
                "left": max(int(left), 0) if left < WARNING_SECONDS else None,
                "by": episode.by.name,
            }
        return status

    def _last_kept(self) -> dict[str, Any] | None:
        """Return the last kept episode for the state; None without any."""
        kept = self._folder.last()
        if kept is None:
            return None
        episode = kept.episode
        return {
            "number": episode.number,
            "outcome": episode.outcome.value,
            "seconds": round(episode.length, 1),
        }

    def _undo(self) -> UndoableJudgement | None:
        undo = self._undoable
        return undo if undo is not None and self._clock() < undo.until else None

    def _note_change(self, notice: str = "") -> None:
        with self._changed:
            self._revision += 1
            if notice:
                self._notice = notice
            self._changed.notify_all()

    # Requests

    def handle(self, request: EpisodeRequest, by: EpisodeGiver) -> dict[str, Any]:
        """Execute ``request`` of ``by`` and return the episode as a message.

        Raises InputError with the reason if that is not possible.
        """
        t = self._clock()
        with self._requests:
            try:
                return self._handle(request, by, t)
            finally:
                self._note_change()

    def _handle(self, request: EpisodeRequest, by: EpisodeGiver, t: float) -> dict[str, Any]:
        match request:
            case StartEpisode(task=task):
                episode = self._start(self._task if task is None else task, by, t)
            case StopEpisode(outcome=outcome):
                episode = self._stop(EpisodeOutcome(outcome), t)
            case JudgeEpisode(number=number, outcome=outcome):
                episode = self._judge(number, EpisodeOutcome(outcome), t)
            case DiscardEpisode(number=number):
                episode = self._discard(number, t)
            case RestoreEpisode(number=number):
                self._folder.restore(number)
                episode = self._folder.find(number).episode
            case UndoEpisode():
                episode = self._undone()
            case RerecordEpisode():
                before = self._discard(None, t)
                episode = self._start(before.task, by, self._clock())
            case DescribeEpisode(number=number, task=task, note=note):
                texts = {"task": task, "note": note}
                changes = {name: text for name, text in texts.items() if text is not None}
                episode = self._folder.change(number, "noted", **changes)
            case TrimEpisode(number=number, begin=begin, end=end):
                episode = self._trim(number, begin, end)
            case _:
                raise AssertionError(f"{type(request).__name__} is not handled.")
        return {**message_of(episode, t, ""), "kind": request.__struct_config__.tag}

    def _start(self, task: str, by: EpisodeGiver, t: float) -> Episode:
        if self._marker is not None:
            if self._unsaved:
                self._save()
            else:
                running = self._marker.episode.number
                raise InputError(f"Episode {running} runs already. End it first.")
        number = self._folder.next_number()
        episode = Episode(number, task.strip(), t, None, EpisodeOutcome.RUNNING, "", by)
        with self._ring.lock:
            first = self._ring.newest
            # It may be finished by a program with another working directory.
            marker = EpisodeMarker(episode, self._ring_folder.absolute(), first, self._run)
            self._folder.mark(marker)
            self._ring.held = first
            self._size_before = self._ring.size_from(first)
            self._ring.describe(t, message_of(episode, t, "begun"))
            problem = self._ring.problem
        if problem:
            self._folder.unmark(number)
            self._ring.held = None
            raise InputError(problem)
        self._marker, self._task = marker, episode.task
        return episode

    def _stop(self, outcome: EpisodeOutcome, t: float) -> Episode:
        marker = self._marker
        if marker is None or marker.episode.end is not None:
            raise InputError("No episode runs.")
        episode = replace(marker.episode, end=max(t, marker.episode.begin), outcome=outcome)
        self._marker = replace(marker, episode=episode)
        self._saving = True
        self._note_change()
        try:
            with suppress(InputError):
                # Saved at the next start with this end, if this process is killed now. A full disk
                # is reported below.
                self._folder.mark(self._marker)
            self._wait_for_ticks(t)
            with self._ring.lock:
                self._ring.describe(t, message_of(episode, t, "ended"))
            return self._save()
        finally:
            self._saving = False

    def _wait_for_ticks(self, t: float) -> None:
        """Wait until the ticks until ``t`` [s] have arrived; an arm at rest has none."""
        deadline, newest, heard = time.monotonic() + MAX_WAIT, self._ring.last_t, time.monotonic()
        while newest < t and time.monotonic() < min(deadline, heard + LATE_SECONDS):
            time.sleep(0.02)
            if self._ring.last_t != newest:
                newest, heard = self._ring.last_t, time.monotonic()

    def _save(self) -> Episode:
        """Write the file of the episode that has ended; keep it for another attempt if not."""
        marker = self._marker
        assert marker is not None
        number = marker.episode.number
        try:
            episode = cut_out(self._folder, marker, "ended")
        except NothingRecordedError:
            self._forget(number)
            raise
        except InputError as error:
            self._unsaved, self._retry_at = True, time.monotonic() + RETRY_SECONDS
            self._problem = f"Episode {number} is not saved yet: {error}"
            log.error("%s", self._problem)
            raise InputError(f"{self._problem} It is tried again every few seconds.") from error
        self._forget(number)
        return episode

    def _forget(self, number: int) -> None:
        """Release the files of the ring that episode ``number`` has needed."""
        self._folder.unmark(number)
        self._marker, self._unsaved, self._retry_at, self._problem = None, False, float("inf"), ""
        self._hold_interrupted()

    def _hold_interrupted(self) -> None:
        """Hold the files of the ring that interrupted episodes still need."""
        ring = self._ring_folder.absolute()
        firsts = [each.first for each in self._folder.markers() if each.ring == ring]
        self._ring.held = min(firsts, default=None)

    def _runs(self, number: int | None) -> bool:
        """Return whether the episode of ``number``, or for None any one, runs.

        Raises InputError for one that has ended and could not be saved yet.
        """
        marker = self._marker
        if marker is None or number not in (None, marker.episode.number):
            return False
        if marker.episode.end is not None:
            raise InputError(self._problem)
        return True

    def _last(self, number: int | None) -> Episode:
        """Return the episode of ``number``; for None the last one."""
        if number is not None:
            return self._folder.find(number).episode
        kept = self._folder.last()
        if kept is None:
            raise InputError("There is no episode yet.")
        return kept.episode

    def _judge(self, number: int | None, outcome: EpisodeOutcome, t: float) -> Episode:
        if self._runs(number):
            # With its outcome, which is kept if it can only be saved later.
            episode, before = self._stop(outcome, t), EpisodeOutcome.UNJUDGED
        else:
            found = self._last(number)
            episode = self._folder.change(found.number, "judged", outcome=outcome)
            before = found.outcome
        until = self._clock() + UNDO_SECONDS
        self._undoable = UndoableJudgement(episode.number, before, until)
        return episode

    def _discard(self, number: int | None, t: float) -> Episode:
        runs = self._runs(number)
        episode = self._stop(EpisodeOutcome.UNJUDGED, t) if runs else self._last(number)
        self._folder.discard(episode.number)
        until = self._clock() + UNDO_SECONDS
        self._undoable = UndoableJudgement(episode.number, None, until)
        return episode

    def _undone(self) -> Episode:
        undo = self._undo()
        if undo is None:
            raise InputError(
                f"There is nothing to undo: only the last judgement, for {UNDO_SECONDS:g} s. The "
                "list of episodes changes every one."
            )
        self._undoable = None
        if undo.before is None:
            self._folder.restore(undo.number)
            return self._folder.find(undo.number).episode
        return self._folder.change(undo.number, "judged", outcome=undo.before)

    def _trim(self, number: int, begin: float, end: float) -> Episode:
        found = self._folder.find(number)
        length = found.stop - found.start
        start, stop = found.start + begin, min(found.start + end, found.stop)
        # The page shows tenths of a second.
        if not start < stop or end > length + 0.1:
            raise InputError(
                f"Episode {number} lasts {length:.1f} s: choose a begin from 0 s, and an end after "
                "it up to there."
            )
        return self._folder.change(number, "trimmed", begin=start, end=stop)

    # Over time

    def tick(self) -> None:
        """End an episode that has reached the maximum, and save one that could not be saved."""
        if not self.active or self._saving:
            return
        with self._requests:
            marker = self._marker
            if marker is None:
                return
            episode = marker.episode
            if self._unsaved and time.monotonic() >= self._retry_at:
                with suppress(InputError):
                    self._save()
                    self._note_change(f"Episode {episode.number} is saved now.")
            elif episode.end is None and self._clock() - episode.begin >= MAX_SECONDS:
                notice = f"Episode {episode.number} ended after {MAX_SECONDS / 60:g} minutes."
                with suppress(InputError):
                    self._stop(EpisodeOutcome.UNJUDGED, self._clock())
                self._note_change(notice)

    def close(self) -> None:
        """End an episode that runs, because the server ends."""
        with self._requests, suppress(InputError):
            if self._marker is not None and self._marker.episode.end is None:
                self._stop(EpisodeOutcome.UNFINISHED, self._clock())
        self._folder.release()
