"""Writer of LeRobot datasets, version 3.0: features, paths, exact statistics, and Parquet files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.recording.files.attempts import PERSON, POLICY, PROGRAM
from katana450.extras import library
from katana450.maths.geometry.arrays import FloatArray, IntArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Quantiles by their names."""

LEVELS = 256
"""Number of levels of a colour."""

Statistics = dict[str, list[Any]]
"""Statistics of a feature by their names."""


def column_statistics(values: npt.NDArray[Any]) -> Statistics:
    """Return the statistics of ``values`` (N, n) over their N rows, each a list of n numbers.

    ``std`` is that of the rows themselves, with the divisor N. Quantiles between two values are
    interpolated. ``count`` is a list of one number.
    """
    numbers = np.asarray(values, dtype=np.float64)
    statistics = {
        "min": numbers.min(axis=0),
        "max": numbers.max(axis=0),
        "mean": numbers.mean(axis=0),
        "std": numbers.std(axis=0),
    }
    quantiles = np.quantile(numbers, tuple(QUANTILES.values()), axis=0)
    statistics.update(zip(QUANTILES, quantiles, strict=True))
    lists: Statistics = {name: value.tolist() for name, value in statistics.items()}
    return {**lists, "count": [len(numbers)]}


class PixelCounts:
    """Counts of the levels of red, green and blue in pictures, from which statistics follow."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, LEVELS), dtype=np.int64)
        self._pictures = 0

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Count the pixels of ``picture`` (height, width, 3)."""
        for colour in range(3):
            self._counts[colour] += np.bincount(picture[:, :, colour].ravel(), minlength=LEVELS)
        self._pictures += 1

    def merge(self, other: PixelCounts) -> None:
        """Add the counts of ``other``."""
        self._counts += other._counts
        self._pictures += other._pictures

    @property
    def statistics(self) -> Statistics:
        """The statistics of all pixels, each (3, 1, 1) from 0 to 1; ``count`` is of pictures."""
        levels = np.arange(LEVELS) / (LEVELS - 1)
        total = self._counts.sum(axis=1)
        mean = self._counts @ levels / total
        spread = np.array(
            [
                counts @ (levels - middle) ** 2
                for counts, middle in zip(self._counts, mean, strict=True)
            ]
        )
        statistics = {
            "min": [levels[np.flatnonzero(counts)[0]] for counts in self._counts],
            "max": [levels[np.flatnonzero(counts)[-1]] for counts in self._counts],
            "mean": mean,
            "std": np.sqrt(spread / total),
        }
        for name, fraction in QUANTILES.items():
            statistics[name] = [
                np.quantile(levels, fraction, weights=counts, method="inverted_cdf")
                for counts in self._counts
            ]
        lists: Statistics = {
            name: np.asarray(value, dtype=np.float64).reshape(3, 1, 1).tolist()
            for name, value in statistics.items()
        }
        return {**lists, "count": [self._pictures]}


VERSION: Final = "v3.0"
"""Version of the form."""

CHUNK_FILES = 1000
DATA_MB, VIDEO_MB = 100, 200
"""Maximum number of files in a folder, and size [MB] after which programs that add episodes begin a
new file of rows or pictures. Here all rows are in one file, and the pictures of a view in one film.
"""

FIRST_FILE = {"chunk_index": 0, "file_index": 0}
"""Numbers of the only file."""

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
TASKS_PATH = "meta/tasks.parquet"
INFO_PATH = "meta/info.json"
STATS_PATH = "meta/stats.json"

STATE, ACTION = "observation.state", "action"
DONE, SUCCEEDED = "next.done", "next.success"
INTERVENTION = "complementary_info.is_intervention"
"""1 where a person drove the arm, by the name that learners from corrections read; else 0."""

SOURCE, SOURCES = "complementary_info.source", (PERSON, PROGRAM, POLICY)
"""Index in SOURCES of what commanded the newest motion; -1 before the first motion."""

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
        cameras: width and height of the pictures of each camera [px].
    """

    robot: str
    joints: int
    gripper: bool
    fps: int
    cameras: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Names of the numbers in a state and in an action."""
        names = [f"theta{axis}.pos" for axis in range(1, self.joints + 1)]
        return [*names, "gripper.pos"] if self.gripper else names

    @property
    def videos(self) -> dict[str, str]:
        """Name of the feature of each camera."""
        return {name: f"observation.images.{name}" for name in self.cameras}

    @property
    def features(self) -> dict[str, dict[str, Any]]:
        """All features by name, each with type, shape and names. No name has a slash."""
        vector = {"dtype": "float32", "shape": [len(self.names)], "names": self.names}
        return {
            STATE: vector,
            ACTION: vector,
            **{self.videos[name]: self._video(*size) for name, size in self.cameras.items()},
            **{name: _scalar("bool") for name in (DONE, SUCCEEDED)},
            **{name: _scalar("float32") for name in (INTERVENTION, TIMESTAMP)},
            **{name: _scalar("int64") for name in (SOURCE, FRAME, EPISODE, INDEX, TASK)},
        }

    def _video(self, width: int, height: int) -> dict[str, Any]:
        return {
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
            "video_path": VIDEO_PATH if self.cameras else None,
            "features": self.features,
        }


def _scalar(kind: str) -> dict[str, Any]:
    return {"dtype": kind, "shape": [1], "names": None}


def pandas_metadata() -> bytes:
    """Return the metadata by which pandas reads the texts of the table of tasks as its index."""
    number = {"pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    text = {"pandas_type": "unicode", "numpy_type": "object"}
    names = {"name": None, "field_name": None, **text, "metadata": {"encoding": "UTF-8"}}
    return json.dumps(
        {
            "index_columns": [TASK_COLUMN],
            "column_indexes": [names],
            "columns": [
                {"name": TASK, "field_name": TASK, **number},
                {"name": None, "field_name": TASK_COLUMN, **text, "metadata": None},
            ],
            "creator": {"library": "pyarrow", "version": "0"},
            "pandas_version": "2.0.0",
        }
    ).encode()


def arrow() -> tuple[Any, Any]:
    """Return the modules ``pyarrow`` and ``pyarrow.parquet``.

    Raises MissingExtraError if pyarrow is not installed.
    """
    what = "LeRobot datasets"
    return library("pyarrow", "datasets", what), library("pyarrow.parquet", "datasets", what)


MAX_VALUE = 1e6
"""[rad or m] Maximum value of a joint; 32 bits hold it."""

TASK_COLUMN = "__index_level_0__"
"""Column of a table that pandas writes for an index without a name."""

COUNT = "count"


class LerobotWriter:
    """Writes the rows of one dataset, episode by episode, into a folder."""

    def __init__(self, folder: Path, shape: DatasetShape) -> None:
        """Begin a dataset in ``folder``. Raises ConfigurationError without pyarrow."""
        self._arrow, self._parquet = arrow()
        self._folder, self._shape = folder, shape
        self._schema = self._arrow.schema(
            [
                (name, self._type(feature["dtype"], feature["shape"]))
                for name, feature in shape.features.items()
                if feature["dtype"] != "video"
            ]
        )
        path = folder / DATA_PATH.format(**FIRST_FILE)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._data = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        self._tasks: dict[str, int] = {}
        self._rows: list[dict[str, Any]] = []
        self._columns: list[dict[str, npt.NDArray[Any]]] = []
        self._frames = 0

    def add_episode(
        self,
        state: FloatArray,
        action: FloatArray,
        sources: IntArray,
        task: str,
        success: bool | None,
        videos: Mapping[str, Any],
        picture_statistics: Mapping[str, Statistics],
    ) -> None:
        """Add an episode of N frames.

        Args:
            state: (N, n) state of each frame [rad or m].
            action: (N, n) action of each frame [rad or m].
            sources: (N,) the place in SOURCES of what drove the arm in each frame, or -1.
            task: its task.
            success: whether the task was done; None if that is not known.
            videos: further columns of its row, which tell where its pictures are.
            picture_statistics: statistics of the pictures, by features.

        Raises:
            InputError: the episode has another number of joints, or impossible values.
        """
        if state.shape[1] != len(self._shape.names):
            raise InputError(
                f"Episode {len(self._rows)} of the dataset has states of {state.shape[1]} numbers, "
                f"not {len(self._shape.names)}: its recording is of another robot."
            )
        farthest = max(float(np.abs(values).max(initial=0.0)) for values in (state, action))
        if farthest > MAX_VALUE:
            raise InputError(
                f"Episode {len(self._rows)} of the dataset has a joint at {farthest:g} rad or m. "
                "Its recording is damaged."
            )
        count, number = len(state), len(self._rows)
        last = np.arange(count) == count - 1
        columns: dict[str, npt.NDArray[Any]] = {
            STATE: state.astype(np.float32),
            ACTION: action.astype(np.float32),
            INTERVENTION: (sources == SOURCES.index(PERSON)).astype(np.float32),
            SOURCE: sources,
            DONE: last,
            SUCCEEDED: last & (success is True),
            TIMESTAMP: (np.arange(count) / self._shape.fps).astype(np.float32),
            FRAME: np.arange(count),
            EPISODE: np.full(count, number),
            INDEX: np.arange(self._frames, self._frames + count),
            TASK: np.full(count, self._tasks.setdefault(task, len(self._tasks))),
        }
        self._write_rows(columns)
        row = {
            "episode_index": number,
            "tasks": [task],
            "length": count,
            **{f"data/{index}": number for index, number in FIRST_FILE.items()},
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
            "success": success,
            **{f"meta/episodes/{index}": number for index, number in FIRST_FILE.items()},
            **videos,
        }
        for feature, statistics in {**_statistics(columns), **picture_statistics}.items():
            row |= {f"stats/{feature}/{name}": value for name, value in statistics.items()}
        self._rows.append(row)
        self._columns.append(columns)
        self._frames += count

    def finish(self, picture_statistics: Mapping[str, Statistics]) -> None:
        """Write the descriptions. ``picture_statistics``: those of all pictures, by features."""
        self.close()
        pa, folder = self._arrow, self._folder
        tasks = pa.table(
            {TASK: pa.array(list(self._tasks.values()), pa.int64())}
            | {TASK_COLUMN: pa.array(list(self._tasks), pa.string())}
        )
        pandas = {b"pandas": pandas_metadata()}
        episodes = pa.Table.from_pylist(self._rows, self._episode_schema())
        for path, table in (
            (TASKS_PATH, tasks.replace_schema_metadata(pandas)),
            (EPISODES_PATH, episodes),
        ):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            self._parquet.write_table(table, folder / path, compression="snappy")
        every = {
            name: np.concatenate([columns[name] for columns in self._columns])
            for name in self._columns[0]
        }
        _write_json(folder / STATS_PATH, {**_statistics(every), **picture_statistics})
        info = self._shape.info(len(self._rows), self._frames, len(self._tasks))
        _write_json(folder / INFO_PATH, info)

    def close(self) -> None:
        """Close the file of rows."""
        self._data.close()

    def _write_rows(self, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        arrays = [self._array(field, columns[field.name]) for field in self._schema]
        self._data.write_table(self._arrow.table(arrays, self._schema))

    def _array(self, field: Any, values: npt.NDArray[Any]) -> Any:
        pa = self._arrow
        if not pa.types.is_fixed_size_list(field.type):
            return pa.array(values, field.type)
        flat = pa.array(values.ravel(), field.type.value_type)
        return pa.FixedSizeListArray.from_arrays(flat, field.type.list_size)

    def _type(self, kind: str, shape: list[int]) -> Any:
        pa = self._arrow
        types = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}[kind]
        return types if shape == [1] else pa.list_(types, shape[0])

    def _episode_schema(self) -> Any:
        """Return the types of the columns of episodes, by their names."""
        pa = self._arrow
        numbers = pa.list_(pa.float64())
        kinds = {"tasks": pa.list_(pa.string()), "success": pa.bool_()}
        fields = []
        for name in self._rows[0]:
            if name.startswith("stats/"):
                pictures = name.startswith("stats/observation.images.")
                nested = pa.list_(pa.list_(numbers)) if pictures else numbers
                kind = pa.list_(pa.int64()) if name.endswith(f"/{COUNT}") else nested
            elif name.endswith("_timestamp"):
                kind = pa.float64()
            else:
                kind = kinds.get(name, pa.int64())
            fields.append((name, kind))
        return pa.schema(fields)


def _statistics(columns: Mapping[str, npt.NDArray[Any]]) -> dict[str, Statistics]:
    return {
        name: column_statistics(values.reshape(len(values), -1)) for name, values in columns.items()
    }


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False)
    path.write_text(text, encoding="utf-8")
