"""Episodes that a crash has interrupted are made of the files of the ring."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from msgspec.structs import replace

from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import Episode, EpisodeOutcome
from katana450.extensions.recording.episodes.episode_file import write_episode
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder, EpisodeMarker
from katana450.extensions.recording.files.checking import gaps_in
from katana450.extensions.recording.files.keeping import whole_copy
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.messages import STATE
from katana450.extensions.recording.places import recordings_in

log = logging.getLogger(__name__)

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
    with _sources(marker) as sources:
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
    said = []
    for marker in markers:
        number = marker.episode.number
        if any(folder.path(number, discarded=each).exists() for each in (False, True)):
            folder.unmark(number)
            continue
        try:
            cut_out(folder, marker, "unfinished")
        except NothingRecordedError:
            said.append(f"Episode {number} was interrupted before anything was recorded.")
        except InputError as error:
            said.append(f"Episode {number} cannot be saved: {error}")
            log.error("%s", said[-1])
            continue
        else:
            said.append(f"Episode {number} was interrupted and is kept as unfinished.")
        log.warning("%s", said[-1])
        folder.unmark(number)
    return said


@contextmanager
def _sources(marker: EpisodeMarker) -> Iterator[list[Path]]:
    """Yield whole files of the ring with the ticks of the episode of ``marker``."""
    with tempfile.TemporaryDirectory(prefix="katana450-") as temporary:
        found = []
        for written in recordings_in(marker.ring):
            path = written
            if path.name < marker.first:
                continue
            run = _run_of(path)
            if run is None:
                # The file that is being written, or one that a crash left open.
                copy = whole_copy(path, Path(temporary) / path.name)
                if copy is None:
                    continue
                path, run = copy, _run_of(copy)
            if run == marker.run:
                found.append(path)
        yield found


def _run_of(path: Path) -> str | None:
    """Return the run of the server that wrote ``path``; empty without any message.

    Returns None if the file has no valid end.
    """
    try:
        with RecordingFile.open(path) as file:
            return file.metadata.get("utc_offset_ns", "") if any(file.counts().values()) else ""
    except InputError:
        return None


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
