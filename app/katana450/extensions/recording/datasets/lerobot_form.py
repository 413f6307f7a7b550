"""The form of a LeRobot dataset, version 3.0: features, paths and descriptions."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

VERSION: Final = "v3.0"
"""Version of the form."""

CHUNK_FILES = 1000
"""Maximum number of files in a folder."""

DATA_MB, VIDEO_MB = 100, 200
"""[MB] Size of a file of rows or pictures after which the next episode begins a new one."""

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
TASKS_PATH = "meta/tasks.parquet"
INFO_PATH = "meta/info.json"
STATS_PATH = "meta/stats.json"

STATE, ACTION = "observation.state", "action"
DONE, SUCCEEDED = "next.done", "next.success"
TIMESTAMP, FRAME, EPISODE, INDEX, TASK = (
    "timestamp",
    "frame_index",
    "episode_index",
    "index",
    "task_index",
)

VIDEO_CODEC, PIXEL_FORMAT = "h264", "yuv420p"


@dataclass(frozen=True)
class DatasetShape:
    """The content of each frame of a dataset.

    Attributes:
        robot: name of the robot.
        joints: number of joints, without the gripper.
        gripper: whether it has a gripper.
        fps: frames per second.
        views: names of the cameras.
        size: width and height of their pictures [px].
    """

    robot: str
    joints: int
    gripper: bool
    fps: int
    views: tuple[str, ...] = ()
    size: tuple[int, int] = (0, 0)

    @property
    def names(self) -> list[str]:
        """Names of the numbers in a state and in an action."""
        names = [f"theta{axis}.pos" for axis in range(1, self.joints + 1)]
        return [*names, "gripper.pos"] if self.gripper else names

    @property
    def videos(self) -> dict[str, str]:
        """Name of the feature of each view."""
        return {view: f"observation.images.{view}" for view in self.views}

    @property
    def features(self) -> dict[str, dict[str, Any]]:
        """All features by name, each with type, shape and names. No name has a slash."""
        vector = {"dtype": "float32", "shape": [len(self.names)], "names": self.names}
        width, height = self.size
        pictures = {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": height,
                "video.width": width,
                "video.codec": VIDEO_CODEC,
                "video.pix_fmt": PIXEL_FORMAT,
                "video.is_depth_map": False,
                "video.fps": self.fps,
                "video.channels": 3,
                "has_audio": False,
            },
        }
        return {
            STATE: vector,
            ACTION: vector,
            **dict.fromkeys(self.videos.values(), pictures),
            **{name: _scalar("bool") for name in (DONE, SUCCEEDED)},
            TIMESTAMP: _scalar("float32"),
            **{name: _scalar("int64") for name in (FRAME, EPISODE, INDEX, TASK)},
        }

    def info(self, episodes: int, frames: int, tasks: int) -> dict[str, Any]:
        """Return the content of ``meta/info.json`` for these counts."""
        return {
            "codebase_version": VERSION,
            "robot_type": self.robot,
            "total_episodes": episodes,
            "total_frames": frames,
            "total_tasks": tasks,
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self.fps,
            "splits": {"train": f"0:{episodes}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self.views else None,
            "features": self.features,
        }


def _scalar(kind: str) -> dict[str, Any]:
    return {"dtype": kind, "shape": [1], "names": None}


def place(number: int) -> tuple[int, int]:
    """Return the numbers of folder and file of the file with ``number``, from 0."""
    return divmod(number, CHUNK_FILES)


def episode_row(
    number: int, task: str, frames: tuple[int, int], success: bool | None, data_file: int
) -> dict[str, Any]:
    """Return the row that describes an episode, without its videos and statistics.

    Args:
        number: index of the episode.
        task: its task.
        frames: index of its first frame, and of the first frame after it.
        success: whether the task was done; None if that is not known.
        data_file: number of the file that has its rows.
    """
    chunk, file = place(data_file)
    return {
        "episode_index": number,
        "tasks": [task],
        "length": frames[1] - frames[0],
        "data/chunk_index": chunk,
        "data/file_index": file,
        "dataset_from_index": frames[0],
        "dataset_to_index": frames[1],
        "success": success,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }


def statistics_columns(statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the columns of the row of an episode for the statistics of its features."""
    return {
        f"stats/{feature}/{name}": value
        for feature, values in statistics.items()
        for name, value in values.items()
    }


def pandas_metadata(index: str, columns: Sequence[str]) -> bytes:
    """Return the metadata by which pandas reads the text column ``index`` as the index.

    ``columns``: names of the other columns, which are int64.
    """
    described = [
        {
            "name": name,
            "field_name": name,
            "pandas_type": "int64",
            "numpy_type": "int64",
            "metadata": None,
        }
        for name in columns
    ]
    text = {"pandas_type": "unicode", "numpy_type": "object"}
    described.append({"name": None, "field_name": index, **text, "metadata": None})
    names = {"name": None, "field_name": None, **text, "metadata": {"encoding": "UTF-8"}}
    return json.dumps(
        {
            "index_columns": [index],
            "column_indexes": [names],
            "columns": described,
            "creator": {"library": "pyarrow", "version": "0"},
            "pandas_version": "2.0.0",
        }
    ).encode()
