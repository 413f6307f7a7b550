"""Export of episodes as a LeRobot dataset, with videos of any views."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.media.film import VideoEncoder, ffmpeg
from katana450.extensions.progress import progress
from katana450.extensions.recording.datasets.lerobot_writer import (
    FIRST_FILE,
    SOURCES,
    VIDEO_PATH,
    DatasetShape,
    LerobotWriter,
    PixelCounts,
    arrow,
)
from katana450.extensions.recording.datasets.recorded_pictures import (
    Pixels,
    cameras_of,
    recorded_pictures,
)
from katana450.extensions.recording.episodes.episode import JUDGED, EpisodeOutcome
from katana450.extensions.recording.episodes.episode_folder import episodes_in
from katana450.extensions.recording.files.attempts import lasting_spans, source_of
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import check_whole, given_commands
from katana450.extensions.recording.files.spans import Span, at_place, length_of
from katana450.extensions.recording.files.table import (
    RecordedStates,
    check_fps,
    columns_from,
    frame_times,
    sampled,
)
from katana450.extensions.recording.folders import new_folder
from katana450.maths.geometry.arrays import FloatArray, IntArray

CRF = 18
"""Quality of the encoding, from 0 (exact) to 51."""

KEY_PICTURES = 2
"""Every second picture can be decoded alone, so that training may read them in any order."""


class EpisodeVideo:
    """Writes the pictures of one view as one film."""

    def __init__(self, folder: Path, feature: str, size: tuple[int, int], fps: int) -> None:
        """Begin the film in the dataset in ``folder``.

        Args:
            folder: folder of the dataset.
            feature: name of the feature.
            size: width and height [px], both even.
            fps: pictures per second.
        """
        self._feature, self._fps = feature, fps
        path = folder / VIDEO_PATH.format(video_key=feature, **FIRST_FILE)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Pictures that refer to later ones would not begin at time 0.
        options = ("-crf", str(CRF), "-g", str(KEY_PICTURES), "-bf", "0")
        self.encoder = VideoEncoder(path, size, fps, *options)
        """The film, which must be finished or abandoned."""
        self._written = self._begin = 0
        self.counts = PixelCounts()
        """Pixels of all episodes that have ended."""
        self._episode = PixelCounts()

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add the next ``picture`` (height, width, 3) of the present episode."""
        self.encoder.add(picture)
        self._episode.add(picture)
        self._written += 1

    def end_episode(self) -> tuple[dict[str, Any], dict[str, list[Any]]]:
        """End an episode; return where it is, as columns of its row, and its statistics."""
        named = f"videos/{self._feature}"
        row = {
            **{f"{named}/{index}": number for index, number in FIRST_FILE.items()},
            f"{named}/from_timestamp": self._begin / self._fps,
            f"{named}/to_timestamp": self._written / self._fps,
        }
        statistics = self._episode.statistics
        self.counts.merge(self._episode)
        self._episode, self._begin = PixelCounts(), self._written
        return row, statistics


DEFAULT_OUTCOMES = tuple(outcome.value for outcome in JUDGED)
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
        spans: the parts of the recording that it consists of, on its clock [s].
        task: what was to be done, in words.
        success: whether it was done; None if nobody has judged that.
    """

    path: Path
    spans: tuple[Span, ...]
    task: str
    success: bool | None

    def __str__(self) -> str:
        return f"{self.path} from {self.spans[0].start:.3f} to {self.spans[-1].end:.3f} s"

    def frames(self, fps: int) -> FloatArray:
        """Return the times (N,) [s] of its frames, 1 / ``fps`` apart, after its start."""
        return frame_times(0.0, length_of(self.spans), fps)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the times on the clock of the recording [s] at ``times`` after its start."""
        return np.array([at_place(self.spans, t) for t in times.tolist()])


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings that ``paths`` name: files, and folders of episodes by their numbers.

    Raises InputError for a folder without episodes.
    """
    files: list[Path] = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
            continue
        inside = sorted(path.glob(EPISODE_FILES), key=lambda file: (len(file.name), file.name))
        if not inside:
            raise InputError(f"{path} has no episodes: its files would be {EPISODE_FILES}.")
        files += inside
    return files


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
        start, end = (min(file.start + episode, file.end) for episode in part)
        yield EpisodeCut(file.path, lasting_spans(file, start, end), _task(task, file), None)
        return
    if part[0] > 0.0 or file.start + part[1] < file.end:
        raise InputError(
            f"{file.path} has {len(episodes)} episodes. --from and --to cut recordings without "
            "episodes only."
        )
    for episode in episodes:
        if episode.outcome.value in outcomes and episode.end is not None:
            if (
                not file.start - MAX_OUTSIDE
                <= episode.start
                < episode.end
                <= file.end + MAX_OUTSIDE
            ):
                raise InputError(
                    f"Episode {episode.number} of {file.path} is from {episode.start:.3f} to "
                    f"{episode.end:.3f} s, but the recording is from {file.start:.3f} to "
                    f"{file.end:.3f} s. The file was changed or is damaged."
                )
            success = (
                episode.outcome is EpisodeOutcome.SUCCESS if episode.outcome in JUDGED else None
            )
            task_text = _task(episode.task or task, file, episode.number)
            spans = lasting_spans(file, episode.start, episode.end)
            yield EpisodeCut(file.path, spans, task_text, success)


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


MIN_FRAMES = 2
"""Minimum number of frames of an episode."""

Cameras = Callable[[Iterator[State], int], AbstractContextManager[Iterator[tuple[Pixels, ...]]]]
"""Renders states, of which there is a number: the pictures of all views for each."""


@dataclass(frozen=True)
class LerobotOptions:
    """The requested content of a dataset.

    Attributes:
        fps: frames per second.
        task: task of episodes that have none.
        outcomes: outcomes of the episodes to take.
        part: part of a recording without episodes, in seconds after its start.
        views: views of the scene that are rendered.
        size: width and height of their pictures [px].
        cameras: recorded cameras; None for those that all recordings have.
    """

    fps: int
    task: str = ""
    outcomes: Collection[str] = DEFAULT_OUTCOMES
    part: tuple[float, float] = (0.0, float("inf"))
    views: tuple[str, ...] = ()
    size: tuple[int, int] = (0, 0)
    cameras: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Exported:
    """The content of a dataset: numbers of episodes, frames and successes."""

    episodes: int
    frames: int
    successes: int
    unjudged: int

    def __str__(self) -> str:
        failures = self.episodes - self.successes - self.unjudged
        return (
            f"{self.episodes} episodes ({self.successes} successes, {failures} failures, "
            f"{self.unjudged} not judged), {self.frames} frames"
        )


@dataclass(frozen=True, eq=False)
class _Episode:
    """An episode on its grid of frames: times (N,) [s], states and actions (N, n) [rad or m].

    ``sources`` (N,) tells what drove the arm.
    """

    cut: EpisodeCut
    times: FloatArray
    state: FloatArray
    action: FloatArray
    sources: IntArray
    gripper: bool


def export_lerobot(
    paths: Sequence[Path],
    out: Path,
    options: LerobotOptions,
    session: Session | None = None,
    cameras: Cameras | None = None,
) -> Exported:
    """Write the episodes of the recordings ``paths`` as a dataset to the new folder ``out``.

    Args:
        paths: recordings, or folders of episodes.
        out: the folder; it appears complete or not at all.
        options: what the dataset is to hold.
        session: the rules of the robot, for pictures.
        cameras: the renderer, for pictures.

    Raises:
        InputError: there are no such episodes, or they cannot be a dataset.
        ConfigurationError: pyarrow is not installed.
    """
    arrow()
    check_fps(options.fps)
    cuts, robot = _cuts(files_of(paths), options)
    recorded = cameras_of(list(dict.fromkeys(cut.path for cut in cuts)), options.cameras)
    both = sorted(set(recorded) & set(options.views))
    if both:
        raise InputError(
            f"A recorded camera is {both[0]} too. Leave it out by --cameras or --view."
        )
    if recorded:
        ffmpeg()
    first = _sampled_episode(cuts[0], options.fps)
    joints = first.state.shape[1] - first.gripper
    sizes = dict.fromkeys(options.views, options.size) | recorded
    shape = DatasetShape(robot, joints, first.gripper, options.fps, sizes)
    count = sum(len(cut.frames(options.fps)) for cut in cuts)
    with ExitStack() as stack:
        folder = stack.enter_context(new_folder(out))
        writer = LerobotWriter(folder, shape)
        stack.callback(writer.close)
        videos: list[EpisodeVideo] = []
        for name, feature in shape.videos.items():
            videos.append(EpisodeVideo(folder, feature, sizes[name], options.fps))
            stack.callback(videos[-1].encoder.abandon)
        episodes: Iterator[_Episode] = (_sampled_episode(cut, options.fps) for cut in cuts)
        pictures: Iterator[tuple[Pixels, ...]] = repeat(())
        if cameras is None or session is None:
            episodes = progress(episodes, len(cuts), out.name)
        else:
            states = _states(cuts, options.fps, session)
            pictures = progress(stack.enter_context(cameras(states, count)), count, out.name)
        for episode in episodes:
            camera_pictures = recorded_pictures(episode.cut.path, recorded, episode.times)
            for _ in episode.times:
                for video, picture in zip(
                    videos, next(pictures) + next(camera_pictures), strict=True
                ):
                    video.add(picture)
            columns: dict[str, object] = {}
            statistics = {}
            for feature, video in zip(shape.videos.values(), videos, strict=True):
                row, statistics[feature] = video.end_episode()
                columns.update(row)
            task, success = episode.cut.task, episode.cut.success
            frames = episode.state, episode.action, episode.sources
            writer.add_episode(*frames, task, success, columns, statistics)
        # The last step of the progress.
        next(pictures, None)
        for video in videos:
            video.encoder.finish()
        whole = [video.counts.statistics for video in videos]
        writer.finish(dict(zip(shape.videos.values(), whole, strict=True)))
    successes, unjudged = (sum(cut.success is value for cut in cuts) for value in (True, None))
    return Exported(len(cuts), count, successes, unjudged)


def _cuts(paths: Sequence[Path], options: LerobotOptions) -> tuple[list[EpisodeCut], str]:
    """Return the episodes of ``paths``, which were checked, and the name of their robot."""
    cuts: list[EpisodeCut] = []
    with RecordingFile.open(paths[0]) as first:
        robot = first.metadata.get("robot", "unknown")
        for path in paths:
            with RecordingFile.open(path) as file:
                check_same_robot(first, file)
                for cut in cuts_in(file, options.task, options.outcomes, options.part):
                    for span in cut.spans:
                        check_whole(file, *span)
                    if len(cut.frames(options.fps)) < MIN_FRAMES:
                        raise InputError(
                            f"{cut} has fewer than {MIN_FRAMES} frames at {options.fps} a second. "
                            "Leave it out, or choose more frames per second."
                        )
                    cuts.append(cut)
    if not cuts:
        raise InputError(
            f"There are no episodes with the outcome {' or '.join(options.outcomes)}. Judge them, "
            "or name other outcomes by --outcomes."
        )
    return cuts, robot


def _sampled_episode(cut: EpisodeCut, fps: int) -> _Episode:
    with RecordingFile.open(cut.path) as file:
        table = columns_from(file, cut.spans[0].start, cut.spans[-1].end)
        times = cut.at(cut.frames(fps))
        sources = sources_at(file, times)
    # The action of a frame is the setpoint of the next one: that of the same time would be the
    # state itself where a driver follows without delay.
    later = cut.at(cut.frames(fps) + 1.0 / fps)
    gripper = "position" in table
    state = [sampled(table["t"], table["q"], times)]
    action = [sampled(table["t"], table["setpoint"], later)]
    if gripper:
        state.append(sampled(table["t"], table["gripper"], times)[:, None])
        action.append(sampled(table["t"], table["gripper_setpoint"], later)[:, None])
    return _Episode(cut, times, np.hstack(state), np.hstack(action), sources, gripper)


def sources_at(file: RecordingFile, times: FloatArray) -> IntArray:
    """Return the place in SOURCES of what gave the newest motion at each of ``times`` (N,) [s].

    Before the first motion of the recording, that one counts; -1 without any. Raises InputError.
    """
    givers = [
        (t, SOURCES.index(source_of(actor.channel)))
        for t, (command, actor) in given_commands(file, end=float(times[-1]))
        if actor is not None
        and any(part.traits.supersedes and not part.traits.protective for part in command.parts)
    ]
    if not givers:
        return np.full(len(times), -1)
    begins, sources = map(np.array, zip(*givers, strict=True))
    newest = np.searchsorted(begins, times, side="right") - 1
    return np.asarray(sources[np.maximum(newest, 0)])


def _states(cuts: Sequence[EpisodeCut], fps: int, session: Session) -> Iterator[State]:
    """Yield the states of all frames of all episodes."""
    for cut in cuts:
        with RecordingFile.open(cut.path) as file:
            yield from RecordedStates(file, session).at(cut.at(cut.frames(fps)))
