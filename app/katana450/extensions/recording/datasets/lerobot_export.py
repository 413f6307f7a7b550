"""Export of episodes as a LeRobot dataset, with pictures of any views."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.progress import progress
from katana450.extensions.recording.datasets.arrow import arrow
from katana450.extensions.recording.datasets.episode_cuts import (
    DEFAULT_OUTCOMES,
    EpisodeCut,
    check_same_robot,
    cuts_in,
    files_of,
)
from katana450.extensions.recording.datasets.episode_video import EpisodeVideo
from katana450.extensions.recording.datasets.lerobot_form import DatasetShape
from katana450.extensions.recording.datasets.lerobot_writer import LerobotWriter
from katana450.extensions.recording.datasets.new_folder import new_folder
from katana450.extensions.recording.datasets.sampling import (
    RecordedStates,
    check_fps,
    columns_from,
    frame_times,
    sampled,
)
from katana450.extensions.recording.files.checking import check_whole
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.maths.geometry.arrays import FloatArray

MIN_FRAMES = 2
"""Minimum number of frames of an episode."""

Pixels = npt.NDArray[np.uint8]
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
        views: names of the cameras.
        size: width and height of their pictures [px].
    """

    fps: int
    task: str = ""
    outcomes: Collection[str] = DEFAULT_OUTCOMES
    part: tuple[float, float] = (0.0, float("inf"))
    views: tuple[str, ...] = ()
    size: tuple[int, int] = (0, 0)


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
    """An episode on its grid of frames: times (N,) [s], states and actions (N, n) [rad or m]."""

    cut: EpisodeCut
    times: FloatArray
    state: FloatArray
    action: FloatArray
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
    first = _sampled_episode(cuts[0], options.fps)
    joints = first.state.shape[1] - first.gripper
    shape = DatasetShape(robot, joints, first.gripper, options.fps, options.views, options.size)
    count = sum(len(frame_times(cut.start, cut.end, options.fps)) for cut in cuts)
    with ExitStack() as stack:
        folder = stack.enter_context(new_folder(out))
        writer = LerobotWriter(folder, shape)
        stack.callback(writer.close)
        videos = [
            EpisodeVideo(folder, feature, options.size, options.fps)
            for feature in shape.videos.values()
        ]
        for video in videos:
            stack.callback(video.abandon)
        episodes = (_sampled_episode(cut, options.fps) for cut in cuts)
        if cameras is None or session is None:
            for episode in progress(episodes, len(cuts), out.name):
                _add(writer, episode, {}, {})
        else:
            states = _states(cuts, options.fps, session)
            pictures = progress(stack.enter_context(cameras(states, count)), count, out.name)
            for episode in episodes:
                for _ in episode.times:
                    for video, picture in zip(videos, next(pictures), strict=True):
                        video.add(picture)
                _add_with_videos(writer, episode, shape, videos)
            # The last step of the progress.
            next(pictures, None)
        for video in videos:
            video.finish()
        found = [video.counts.statistics for video in videos]
        writer.finish(dict(zip(shape.videos.values(), found, strict=True)))
    return _exported(cuts, count)


def _cuts(paths: Sequence[Path], options: LerobotOptions) -> tuple[list[EpisodeCut], str]:
    """Return the episodes of ``paths``, which were checked, and the name of their robot."""
    cuts: list[EpisodeCut] = []
    with RecordingFile.open(paths[0]) as first:
        robot = first.metadata.get("robot", "unknown")
        for path in paths:
            with RecordingFile.open(path) as file:
                check_same_robot(first, file)
                for cut in cuts_in(file, options.task, options.outcomes, options.part):
                    check_whole(file, cut.start, cut.end)
                    if len(frame_times(cut.start, cut.end, options.fps)) < MIN_FRAMES:
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
        table = columns_from(file, cut.start, cut.end)
    times = frame_times(cut.start, cut.end, fps)
    # The action of a frame is the setpoint of the next one: that of the same time would be the
    # state itself where a driver follows without delay.
    later = np.minimum(times + 1.0 / fps, cut.end)
    gripper = "position" in table
    state = [sampled(table["t"], table["q"], times)]
    action = [sampled(table["t"], table["setpoint"], later)]
    if gripper:
        state.append(sampled(table["t"], table["gripper"], times)[:, None])
        action.append(sampled(table["t"], table["gripper_setpoint"], later)[:, None])
    return _Episode(cut, times, np.hstack(state), np.hstack(action), gripper)


def _states(cuts: Sequence[EpisodeCut], fps: int, session: Session) -> Iterator[State]:
    """Yield the states of all frames of all episodes."""
    for cut in cuts:
        with RecordingFile.open(cut.path) as file:
            times = frame_times(cut.start, cut.end, fps)
            yield from RecordedStates(file, session).at(times)


def _add(
    writer: LerobotWriter,
    episode: _Episode,
    videos: dict[str, object],
    statistics: dict[str, dict[str, list[object]]],
) -> None:
    cut = episode.cut
    writer.add_episode(episode.state, episode.action, cut.task, cut.success, videos, statistics)


def _add_with_videos(
    writer: LerobotWriter,
    episode: _Episode,
    shape: DatasetShape,
    videos: Sequence[EpisodeVideo],
) -> None:
    columns: dict[str, object] = {}
    statistics = {}
    for feature, video in zip(shape.videos.values(), videos, strict=True):
        row, statistics[feature] = video.end_episode()
        columns.update(row)
    _add(writer, episode, columns, statistics)


def _exported(cuts: Sequence[EpisodeCut], frames: int) -> Exported:
    return Exported(
        len(cuts),
        frames,
        sum(cut.success is True for cut in cuts),
        sum(cut.success is None for cut in cuts),
    )
