"""Check of a folder against the form of LeRobot datasets in ``lerobot_v3.json``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

FORM = json.loads(Path(__file__).with_name("lerobot_v3.json").read_text(encoding="utf-8"))
TYPES = {"str": str, "int": int, "dict": dict}


def rows_of(folder: Path) -> dict[str, list[Any]]:
    """Return the columns of all rows of the dataset."""
    files = sorted((folder / "data").glob("*/*.parquet"))
    columns: dict[str, list[Any]] = {}
    for file in files:
        for name, values in pq.read_table(file).to_pydict().items():
            columns.setdefault(name, []).extend(values)
    return columns


def episodes_of(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(folder / FORM["files"][3]).to_pylist()
    return rows


def check_dataset(folder: Path) -> dict[str, Any]:
    """Assert that ``folder`` has the form; return the content of its ``info.json``."""
    for name in FORM["files"]:
        assert (folder / name).is_file(), name
    info: dict[str, Any] = json.loads((folder / "meta" / "info.json").read_text())
    assert set(info) == set(FORM["info"])
    features = info["features"]
    videos = {name for name, feature in features.items() if feature["dtype"] == "video"}
    for name, wanted in FORM["info"].items():
        if name == "video_path" and not videos:
            assert info[name] is None
        elif wanted in TYPES:
            assert type(info[name]) is TYPES[wanted], name
        else:
            assert info[name] == wanted, name
    width = len(features["observation.state"]["names"])
    assert set(features) - videos == set(FORM["features"])
    assert not any("/" in name for name in features)
    for name, wanted in FORM["features"].items():
        shape = [width if length == "N" else length for length in wanted["shape"]]
        assert (features[name]["dtype"], features[name]["shape"]) == (wanted["dtype"], shape)
    for name in videos:
        assert features[name]["names"] == FORM["video"]["names"]
        assert set(features[name]["info"]) == set(FORM["video"]["info"])
        height, wide = (features[name]["info"][f"video.{side}"] for side in ("height", "width"))
        assert features[name]["shape"] == [height, wide, 3]
    for file in sorted((folder / "data").glob("*/*.parquet")):
        schema = pq.read_schema(file)
        columns = {field.name: str(field.type) for field in schema}
        assert columns == {
            name: kind.replace("N", str(width)) for name, kind in FORM["columns"].items()
        }
    _check_episodes(folder, videos)
    _check_counts(folder, info, features)
    return info


def _check_episodes(folder: Path, videos: set[str]) -> None:
    columns = {field.name: str(field.type) for field in pq.read_schema(folder / FORM["files"][3])}
    stats = {name: kind for name, kind in columns.items() if name.startswith("stats/")}
    places = {
        f"videos/{video}/{name}": kind
        for video in videos
        for name, kind in FORM["episode_videos"].items()
    }
    rest = {name: kind for name, kind in columns.items() if name not in stats}
    assert rest == {**FORM["episodes"], **places}
    wanted = {
        f"stats/{feature}/{name}"
        for feature in {*FORM["features"], *videos}
        for name in FORM["statistics"]
    }
    assert set(stats) == wanted
    tasks = pq.read_table(folder / "meta" / "tasks.parquet")
    assert {field.name: str(field.type) for field in tasks.schema} == FORM["tasks"]
    described = json.loads(tasks.schema.metadata[b"pandas"])
    assert described["index_columns"] == ["__index_level_0__"]


def _check_counts(folder: Path, info: dict[str, Any], features: dict[str, Any]) -> None:
    rows, episodes = rows_of(folder), episodes_of(folder)
    assert len(rows["index"]) == info["total_frames"] == sum(row["length"] for row in episodes)
    assert len(episodes) == info["total_episodes"]
    assert info["splits"] == {"train": f"0:{len(episodes)}"}
    assert rows["index"] == list(range(info["total_frames"]))
    begin = 0
    tasks = pq.read_table(folder / "meta" / "tasks.parquet").to_pydict()
    assert tasks["task_index"] == list(range(info["total_tasks"]))
    for number, row in enumerate(episodes):
        assert row["episode_index"] == number
        end = begin + row["length"]
        assert (row["dataset_from_index"], row["dataset_to_index"]) == (begin, end)
        part = {name: values[begin:end] for name, values in rows.items()}
        assert set(part["episode_index"]) == {number}
        assert part["frame_index"] == list(range(row["length"]))
        grid = np.arange(row["length"]) / info["fps"]
        np.testing.assert_allclose(part["timestamp"], grid, rtol=0, atol=1e-4)
        assert part["next.done"] == [*[False] * (row["length"] - 1), True]
        assert part["next.success"] == [*[False] * (row["length"] - 1), row["success"] is True]
        assert row["tasks"] == [tasks["__index_level_0__"][part["task_index"][0]]]
        begin = end
    stats = json.loads((folder / "meta" / "stats.json").read_text())
    assert set(stats) == set(features)
    for name, stat in stats.items():
        assert set(stat) == set(FORM["statistics"])
        assert stat["count"] == [info["total_frames"]], name
        assert np.isfinite(np.array(stat["q50"])).all()
