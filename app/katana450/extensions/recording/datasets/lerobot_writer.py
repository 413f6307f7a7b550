"""Writer of LeRobot datasets, version 3.0: rows in Parquet files, and descriptions of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.recording.datasets.arrow import arrow
from katana450.extensions.recording.datasets.lerobot_form import (
    ACTION,
    DATA_MB,
    DATA_PATH,
    DONE,
    EPISODE,
    EPISODES_PATH,
    FRAME,
    INDEX,
    INFO_PATH,
    STATE,
    STATS_PATH,
    SUCCEEDED,
    TASK,
    TASKS_PATH,
    TIMESTAMP,
    DatasetShape,
    episode_row,
    pandas_metadata,
    place,
    statistics_columns,
)
from katana450.extensions.recording.datasets.statistics import Statistics, column_statistics
from katana450.maths.geometry.arrays import FloatArray

MEGABYTE = 2**20
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
        self._data: Any = None
        self._data_file, self._data_bytes = -1, 0
        self._tasks: dict[str, int] = {}
        self._rows: list[dict[str, Any]] = []
        self._columns: list[dict[str, npt.NDArray[Any]]] = []
        self._frames = 0

    def add_episode(
        self,
        state: FloatArray,
        action: FloatArray,
        task: str,
        success: bool | None,
        videos: Mapping[str, Any],
        picture_statistics: Mapping[str, Statistics],
    ) -> None:
        """Add an episode of N frames.

        Args:
            state: (N, n) state of each frame [rad or m].
            action: (N, n) action of each frame [rad or m].
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
        farthest = max(float(np.abs(each).max(initial=0.0)) for each in (state, action))
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
            DONE: last,
            SUCCEEDED: last & (success is True),
            TIMESTAMP: (np.arange(count) / self._shape.fps).astype(np.float32),
            FRAME: np.arange(count),
            EPISODE: np.full(count, number),
            INDEX: np.arange(self._frames, self._frames + count),
            TASK: np.full(count, self._tasks.setdefault(task, len(self._tasks))),
        }
        self._write_rows(columns)
        statistics = {**_statistics(columns), **picture_statistics}
        frames = (self._frames, self._frames + count)
        row = episode_row(number, task, frames, success, self._data_file)
        self._rows.append({**row, **videos, **statistics_columns(statistics)})
        self._columns.append(columns)
        self._frames += count

    def finish(self, picture_statistics: Mapping[str, Statistics]) -> None:
        """Write the descriptions. ``picture_statistics``: those of all pictures, by features."""
        self.close()
        pa, folder = self._arrow, self._folder
        tasks = pa.table(
            {"task_index": pa.array(list(self._tasks.values()), pa.int64())}
            | {TASK_COLUMN: pa.array(list(self._tasks), pa.string())}
        )
        pandas = {b"pandas": pandas_metadata(TASK_COLUMN, ["task_index"])}
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
        """Close the present file of rows."""
        if self._data is not None:
            self._data.close()
            self._data = None

    def _write_rows(self, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        table = self._arrow.table(
            [self._array(field, columns[field.name]) for field in self._schema], self._schema
        )
        if self._data_bytes > DATA_MB * MEGABYTE:
            self.close()
        if self._data is None:
            self._data_file, self._data_bytes = self._data_file + 1, 0
            chunk, file = place(self._data_file)
            path = self._folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._data = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        self._data.write_table(table)
        self._data_bytes += table.nbytes

    def _array(self, field: Any, values: npt.NDArray[Any]) -> Any:
        pa = self._arrow
        if not pa.types.is_fixed_size_list(field.type):
            return pa.array(values, field.type)
        flat = pa.array(values.ravel(), field.type.value_type)
        return pa.FixedSizeListArray.from_arrays(flat, field.type.list_size)

    def _type(self, kind: str, shape: list[int]) -> Any:
        pa = self._arrow
        found = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}[kind]
        return found if shape == [1] else pa.list_(found, shape[0])

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
