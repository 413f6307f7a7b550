"""Episodes in the process that records: begun, ended, judged and kept in their folder.

Requests come one after another, each in the thread of its connection. The state for the pages is
read meanwhile.
"""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import (
    Episode,
    EpisodeGiver,
    EpisodeOutcome,
    message_of,
)
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder, EpisodeMarker
from katana450.extensions.recording.episodes.running_episode import (
    MAX_SECONDS,
    NOTHING,
    RunningEpisode,
    finish_interrupted,
)
from katana450.extensions.recording.files.attempts import ATTEMPT
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live.ring import Ring
from katana450.server.api.episode_requests import (
    DescribeAttempt,
    DescribeEpisode,
    DiscardEpisode,
    EpisodeRequest,
    JudgeEpisode,
    KeepEpisode,
    RerecordEpisode,
    RestoreEpisode,
    StartEpisode,
    StopEpisode,
    TrimEpisode,
)

log = logging.getLogger(__name__)

RECENT = 600.0
"""[s] Maximum age of a recording that the notice is about; the ring holds ten minutes."""


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
        """Use ``folder``, which is claimed.

        Episodes that a crash interrupted are finished in a thread of their own, so that the ticks
        do not wait for an hour that is copied.

        Args:
            folder: the folder of episodes.
            ring: the ring that is written in this process.
            ring_folder: its folder.
            run: nanoseconds to add to the times of this run for those since the epoch, as in the
                metadata of its recordings.
            clock: the clock of the recording [s].
        """
        self._folder, self._ring, self._ring_folder = folder, ring, ring_folder
        self._clock, self._utc_offset = clock, 1e-9 * int(run)
        self._requests = threading.Lock()
        self._changed = threading.Condition()
        self._notice = _earlier(ring_folder)
        self._revision = 0
        self._running = RunningEpisode(folder, ring, ring_folder, run, self._note_change)
        interrupted, last = folder.markers(), folder.last()
        newest = interrupted[-1] if interrupted else last
        self._task = "" if newest is None else newest.episode.task
        self.finishing = threading.Thread(
            target=self._finish, args=(interrupted,), name="interrupted episodes", daemon=True
        )
        """The thread that finishes interrupted episodes."""
        self.finishing.start()

    def _finish(self, interrupted: Sequence[EpisodeMarker]) -> None:
        try:
            for sentence in finish_interrupted(self._folder, interrupted):
                self._note_change(sentence)
            self._running.hold_needed()
        except Exception:
            # They keep their markers, and new episodes can be recorded.
            log.exception("Interrupted episodes could not be finished.")

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
        """True if the state changes by itself, because an episode runs."""
        return self._running.episode is not None

    def status(self) -> dict[str, Any]:
        """Return the state as JSON values."""
        return {
            "revision": self._revision,
            "running": self._running.status(self._clock()),
            "saving": self._running.saving,
            "count": self._folder.count(),
            "task": self._task,
            "last": self._last_kept(),
            "problem": self._without_paths(self._running.problem),
            "notice": self._without_paths(self._notice),
        }

    def _last_kept(self) -> dict[str, Any] | None:
        """Return the last kept episode for the state; None without any."""
        last = self._folder.last()
        if last is None:
            return None
        episode = last.episode
        return {
            "number": episode.number,
            "outcome": episode.outcome.value,
            "seconds": round(episode.length, 1),
            "missing_ticks": episode.missing_ticks,
        }

    def _without_paths(self, text: str) -> str:
        """Return ``text`` for all who watch: where files are does not concern them."""
        for folder, name in (
            (self._folder.folder, "the folder of episodes"),
            (self._ring_folder.absolute(), "the folder of the last minutes"),
        ):
            text = text.replace(f"{folder}{os.sep}", "").replace(str(folder), name)
        return text

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
        kind = str(request.__struct_config__.tag)
        match request:
            case StartEpisode(task=task):
                episode = self._start(self._task if task is None else task, by, t)
            case StopEpisode(outcome=outcome, number=number):
                episode = self._stop(EpisodeOutcome(outcome), t, number)
            case JudgeEpisode(number=number, outcome=outcome):
                episode = self._judge(number, EpisodeOutcome(outcome), t)
            case DiscardEpisode(number=number):
                episode = self._discard(number, t)
            case RestoreEpisode(number=number):
                episode = self._move(number, discard=False)
            case RerecordEpisode(number=number):
                episode = self._rerecord(number, by, t)
            case KeepEpisode(start=start, end=end):
                task = self._task if request.task is None else request.task.strip()
                episode = Episode(
                    self._folder.next_number(),
                    task,
                    start - self._utc_offset,
                    min(end - self._utc_offset, t),
                    EpisodeOutcome(request.outcome),
                    "",
                    by,
                )
                episode = self._described(self._running.keep(episode), kind)
            case DescribeEpisode(number=number, task=task, note=note):
                texts = {"task": task, "note": note}
                changes = {name: text for name, text in texts.items() if text is not None}
                episode = self._change(number, "noted", **changes)
            case DescribeAttempt(name=name, outcome=outcome, hidden=hidden):
                with self._ring.lock:
                    last = self._ring.last_t
                    if not math.isfinite(last):
                        raise InputError(NOTHING)
                    # Descriptions of episodes may be newer than the newest tick. This one has its
                    # time, so that the recording becomes no longer.
                    moment = min(request.t - self._utc_offset, last)
                    description = {"since": moment, "name": name.strip(), "outcome": outcome}
                    content = ATTEMPT, {**description, "hidden": hidden, "by": by.name}
                    self._ring.describe(last, content)
                return {**description, "number": 0}
            case TrimEpisode(number=number, start=start, end=end):
                episode = self._trim(number, start, end)
            case _:
                raise AssertionError(f"{type(request).__name__} is not handled.")
        message: dict[str, Any] = msgspec.to_builtins(message_of(episode, t, kind))
        return message

    def _change(self, number: int, kind: str, **changes: Any) -> Episode:
        """Write a new description of a kept episode into its file, and into the recording."""
        return self._described(self._folder.change(number, kind, **changes), kind)

    def _described(self, episode: Episode, kind: str) -> Episode:
        """Return ``episode`` after its description is in the recording too."""
        t = self._clock()
        with self._ring.lock:
            self._ring.describe(t, message_of(episode, t, kind))
        return episode

    def _start(self, task: str, by: EpisodeGiver, t: float) -> Episode:
        before = self._running.episode
        if before is not None and before.end is not None:
            self._running.save()
        number = self._folder.next_number()
        episode = Episode(number, task.strip(), t, None, EpisodeOutcome.RUNNING, "", by)
        self._running.start(episode)
        self._task = episode.task
        return episode

    def _stop(self, outcome: EpisodeOutcome, t: float, number: int | None = None) -> Episode:
        self._check_running(number)
        return self._running.stop(outcome, t)

    def _check_running(self, number: int | None) -> None:
        """Raise InputError if another episode than that of ``number`` runs."""
        running = self._running.episode
        if running is not None and number not in (None, running.number):
            raise InputError(
                f"Episode {running.number} runs now, not episode {number}, which has ended."
            )

    def _move(self, number: int, *, discard: bool = True) -> Episode:
        kind = "discarded" if discard else "restored"
        return self._described(self._folder.move(number, discard=discard), kind)

    def _last(self, number: int | None) -> Episode:
        """Return the episode of ``number``; for None the last one."""
        if number is not None:
            return self._folder.find(number).episode
        last = self._folder.last()
        if last is None:
            raise InputError("There is no episode yet.")
        return last.episode

    def _judge(self, number: int | None, outcome: EpisodeOutcome, t: float) -> Episode:
        if self._running.runs(number):
            # With its outcome, which is kept if it can only be saved later.
            return self._stop(outcome, t)
        return self._change(self._last(number).number, "judged", outcome=outcome)

    def _discard(self, number: int | None, t: float) -> Episode:
        if self._running.runs(number):
            number = self._stop(EpisodeOutcome.UNJUDGED, t).number
        return self._move(self._last(number).number)

    def _rerecord(self, number: int | None, by: EpisodeGiver, t: float) -> Episode:
        """Discard the episode that runs, or else the last one, and begin another with its task."""
        if self._running.runs(None):
            self._check_running(number)
            number = self._stop(EpisodeOutcome.UNJUDGED, t).number
        before = self._move(self._last(number).number)
        return self._start(before.task, by, self._clock())

    def _trim(self, number: int, start: float, end: float) -> Episode:
        whole = self._folder.find(number)
        length = whole.end - whole.start
        first, last = whole.start + start, min(whole.start + end, whole.end)
        # The page shows tenths of a second.
        if not first < last or end > length + 0.1:
            raise InputError(
                f"Episode {number} lasts {length:.1f} s: choose a start from 0 s, and an end after "
                "it up to there."
            )
        return self._change(number, "trimmed", start=first, end=last)

    # Over time

    def tick(self) -> None:
        """End an episode that has reached the maximum, and save one that could not be saved."""
        if not self.active or self._running.saving is not None:
            return
        with self._requests:
            episode = self._running.episode
            if episode is None:
                return
            if self._running.retry_due:
                with suppress(InputError):
                    self._running.save()
                    self._note_change(f"Episode {episode.number} is saved now.")
            elif episode.end is None and self._clock() - episode.start >= MAX_SECONDS:
                notice = f"Episode {episode.number} ended after {MAX_SECONDS / 60:g} minutes."
                with suppress(InputError):
                    self._stop(EpisodeOutcome.UNJUDGED, self._clock())
                self._note_change(notice)

    def close(self) -> None:
        """End an episode that runs, because the server ends."""
        with self._requests, suppress(InputError):
            if self._running.runs(None):
                self._stop(EpisodeOutcome.UNFINISHED, self._clock())
        self._folder.release()


def _earlier(folder: Path) -> str:
    """Return a sentence about what the run before this one recorded; "" for nothing recent."""
    with suppress(OSError):
        for path in reversed(recordings_in(folder)):
            if time.time() - path.stat().st_mtime > RECENT:
                break
            return (
                f"What was recorded before the restart is in {path.name}, in the folder that the "
                "server names at its start. The timeline opens it by Open a file…"
            )
    return ""
