"""Reads a dataset by LeRobot's own loader and compares it with what was exported.

Runs in the environment of LeRobot. The arguments are the folder of the dataset and a file with the
expected values, ``expected.npz``. The answer is a line of JSON.
"""

from __future__ import annotations

import json
import sys
import warnings
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.lerobot_command import define_operators


def loader() -> Any:
    """Return LeRobot's class of datasets."""
    define_operators()
    return import_module("lerobot.datasets.lerobot_dataset").LeRobotDataset


NEAR = 3
"""Number of frames before and after."""


def compared(root: Path, expected: Path) -> dict[str, Any]:
    """Return what the loader finds in the dataset ``root``."""
    begin = perf_counter()
    dataset_class = loader()
    imported = perf_counter()
    known = dict(np.load(expected))
    fps = int(known["fps"])
    dataset = dataset_class(
        "local/dataset",
        root=root,
        video_backend="pyav",
        delta_timestamps={"action": [0.0, 1.0 / fps]},
    )
    opened = perf_counter()
    rows = [dataset[number] for number in range(len(dataset))]
    read = perf_counter()
    state = np.array([row["observation.state"].numpy() for row in rows])
    action = np.array([row["action"][0].numpy() for row in rows])
    success = [bool(row["next.success"]) for row in rows]
    found: dict[str, Any] = {
        "lerobot": version("lerobot"),
        "torch": version("torch"),
        "episodes": int(dataset.num_episodes),
        "frames": len(dataset),
        "tasks": sorted({str(row["task"]) for row in rows}),
        "successes": sum(success),
        "import_s": imported - begin,
        "open_s": opened - imported,
        "frame_s": (read - opened) / len(rows),
        "state_error": float(np.abs(state - known["state"]).max()),
        "action_error": float(np.abs(action - known["action"]).max()),
        "outside_quantiles": _outside(state, dataset.meta.stats["observation.state"]),
        "pictures": {},
    }
    for key in dataset.meta.video_keys:
        shown = np.array([row[key].numpy() for row in rows]).transpose(0, 2, 3, 1) * 255.0
        differences = [
            np.abs(shown - picture).mean(axis=(1, 2, 3)) for picture in known[f"pictures {key}"]
        ]
        numbers = known["numbers"].tolist()
        right = [float(each[number]) for each, number in zip(differences, numbers, strict=True)]
        # The episodes resemble each other, so a picture is compared with those before and after.
        near = [
            each[max(number - NEAR, 0) : number + NEAR + 1]
            for each, number in zip(differences, numbers, strict=True)
        ]
        found["pictures"][key] = {
            "compared": len(numbers),
            "largest_mean_difference": max(right),
            "nearest": sum(
                here <= float(each.min()) for here, each in zip(right, near, strict=True)
            ),
        }
    return found


def _outside(state: Any, stats: dict[str, Any]) -> float:
    """Return the largest fraction of frames of a joint outside of q01 to q99."""
    low, high = np.array(stats["q01"]), np.array(stats["q99"])
    return float(((state < low - 1e-6) | (state > high + 1e-6)).mean(axis=0).max())


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print(json.dumps(compared(Path(sys.argv[1]), Path(sys.argv[2]))))
