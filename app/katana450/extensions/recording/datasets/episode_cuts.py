"""Episodes of recordings: which part of which file is an episode of a dataset, and its label."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import JUDGED, EpisodeOutcome
from katana450.extensions.recording.episodes.episode_file import episodes_in
from katana450.extensions.recording.files.recording_file import RecordingFile

DEFAULT_OUTCOMES = tuple(each.value for each in JUDGED)
"""Outcomes that are exported unless others are asked for."""

EPISODE_FILES = "episode-*.mcap"
"""Pattern of the episodes in a folder. Those that were discarded are in a folder below it."""

MAX_OUTSIDE = 60.0
"""[s] Maximum time of an episode before and after its recording, in which the arm rests."""

IDENTITY = ("robot", "urdf_sha256", "settings")
"""Metadata that are the same in all recordings of one robot."""


@dataclass(frozen=True)
class EpisodeCut:
    """A part of a recording that is an episode of a dataset.

    Attributes:
        path: the recording.
        start, end: the part, on the clock of the recording [s].
        task: what was to be done, in words.
        success: whether it was done; None if nobody has judged that.
    """

    path: Path
    start: float
    end: float
    task: str
    success: bool | None

    def __str__(self) -> str:
        return f"{self.path} from {self.start:.3f} to {self.end:.3f} s"


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings that ``paths`` name: files, and folders of episodes by their numbers.

    Raises InputError for a folder without episodes.
    """
    found: list[Path] = []
    for path in paths:
        if not path.is_dir():
            found.append(path)
            continue
        inside = sorted(path.glob(EPISODE_FILES), key=lambda each: (len(each.name), each.name))
        if not inside:
            raise InputError(f"{path} has no episodes: its files would be {EPISODE_FILES}.")
        found += inside
    return found


def cuts_in(
    file: RecordingFile, task: str, outcomes: Collection[str], part: tuple[float, float]
) -> Iterator[EpisodeCut]:
    """Yield the episodes of ``file`` with one of ``outcomes``; without any, the ``part`` of it.

    Args:
        file: the recording.
        task: task of an episode that has none.
        outcomes: outcomes of the episodes to return; a recording without episodes has none.
        part: begin and end of an episode that is the recording, in seconds after its start.

    Raises:
        InputError: an episode has no task, or a part is asked for of a recording with episodes.
    """
    episodes = episodes_in(file)
    if not episodes:
        start, end = (min(file.start + each, file.end) for each in part)
        yield EpisodeCut(file.path, start, end, _task(task, file), None)
        return
    if part[0] > 0.0 or file.start + part[1] < file.end:
        raise InputError(
            f"{file.path} has {len(episodes)} episodes. --from and --to cut recordings without "
            "episodes only."
        )
    for each in episodes:
        if each.outcome.value in outcomes and each.end is not None:
            if not file.start - MAX_OUTSIDE <= each.start < each.end <= file.end + MAX_OUTSIDE:
                raise InputError(
                    f"Episode {each.number} of {file.path} is from {each.start:.3f} to "
                    f"{each.end:.3f} s, but the recording is from {file.start:.3f} to "
                    f"{file.end:.3f} s. The file was changed or is damaged."
                )
            success = each.outcome is EpisodeOutcome.SUCCESS if each.outcome in JUDGED else None
            task_text = _task(each.task or task, file, each.number)
            yield EpisodeCut(file.path, each.start, each.end, task_text, success)


def _task(task: str, file: RecordingFile, number: int | None = None) -> str:
    text = " ".join(task.split())
    if not text:
        named = f"{file.path}" if number is None else f"Episode {number} of {file.path}"
        raise InputError(f"{named} has no task, which a dataset needs. Name it by --task.")
    return text


def check_same_robot(first: RecordingFile, other: RecordingFile) -> None:
    """Raise InputError unless ``other`` is of the robot, tool and settings of ``first``."""
    for name in IDENTITY:
        if first.metadata.get(name) != other.metadata.get(name):
            raise InputError(
                f"{other.path} is not of the same robot, tool and settings as {first.path}: their "
                f"{name} differs. A dataset has one robot; export them to several."
            )
