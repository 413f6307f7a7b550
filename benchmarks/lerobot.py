"""A dataset of recorded episodes, read by LeRobot's own loader.

    python -m benchmarks.lerobot

Episodes are recorded from the control loop, exported with the pictures of two cameras, and opened
by `LeRobotDataset` in an environment of its own under ``.venv-bench``. Its videos are decoded, and
the pictures are compared with those that the renderer makes of the recorded states.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.lerobot_environment import environment_of, prepare_lerobot
from katana450.arm.robot.props import load_props
from katana450.cli.main import main as katana450
from katana450.extensions.media.stage import RenderStage, Shot
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import RecordedStates
from tests.recording.dataset_files import BEGIN, episode_folder
from tests.recording.lerobot_check import check_dataset, episodes_of, rows_of
from tests.recording.recorded import described, swinging

ROOT = Path(__file__).resolve().parents[1]
OUTCOMES = {"success": 3, "failure": 4, "unjudged": 6}
VIEWS = ("free", "tool")
SIZE = (320, 240)
FPS = 30
EVERY = 6
"""Every so many frames are compared."""

MAX_DIFFERENCE = 4.0
"""[of 255] Maximum mean difference of a decoded picture from that of its state."""

TIMEOUT = 1800.0
"""[s] Timeout of the loader."""


def expected_pictures(folder: Path, dataset: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the numbers of some frames, and the pictures of each view there."""
    robot, session, _ = described()
    stage = RenderStage(robot, session, load_props())
    taken: dict[str, list[npt.NDArray[np.uint8]]] = {view: [] for view in VIEWS}
    numbers: list[int] = []
    files = sorted(folder.glob("episode-*.mcap"))
    for path, row in zip(files, episodes_of(dataset), strict=True):
        with RecordingFile.open(path) as file:
            frames = np.arange(0, row["length"], EVERY)
            numbers += (row["dataset_from_index"] + frames).tolist()
            for state in RecordedStates(file, session).at(file.start + BEGIN + frames / FPS):
                for view in VIEWS:
                    shot = Shot(view, SIZE)
                    taken[view].append(shot.taken(stage, robot, state))
    pictures = {
        f"pictures observation.images.{view}": np.array(each) for view, each in taken.items()
    }
    return {"numbers": np.array(numbers), **pictures}


def measured(home: Path) -> dict[str, Any] | str:
    """Return what LeRobot finds, and the time of the export; else why it cannot be asked."""
    python = prepare_lerobot(home)
    if isinstance(python, str):
        return python
    with tempfile.TemporaryDirectory(prefix="katana450-") as temporary:
        folder, out = Path(temporary) / "episodes", Path(temporary) / "dataset"
        episode_folder(folder, OUTCOMES, swinging)
        views = [word for view in VIEWS for word in ("--view", view)]
        look = [*views, "--size", "x".join(map(str, SIZE)), "--fps", str(FPS)]
        chosen = ["--outcomes", ",".join(OUTCOMES), "--format", "lerobot", "--out", str(out)]
        begin = perf_counter()
        if katana450(["record", "export", str(folder), *look, *chosen]) != 0:
            return "the export failed"
        exported = perf_counter() - begin
        check_dataset(out)
        rows = rows_of(out)
        expected = Path(temporary) / "expected.npz"
        np.savez(
            expected,
            allow_pickle=False,
            fps=np.array(FPS),
            state=np.array(rows["observation.state"]),
            action=np.array(rows["action"]),
            **expected_pictures(folder, out),
        )
        done = subprocess.run(
            [str(python), "-m", "benchmarks.lerobot_worker", str(out), str(expected)],
            cwd=ROOT,
            env=environment_of(ROOT, home),
            capture_output=True,
            text=True,
            check=False,
            timeout=TIMEOUT,
        )
        if done.returncode != 0:
            return done.stderr.strip()
        found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return {"export_s": exported, **found}


def main() -> int:
    """Print what LeRobot finds in a dataset; return 1 if it cannot read it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--environment", type=Path, default=ROOT / ".venv-bench" / "lerobot")
    found = measured(parser.parse_args().environment)
    if isinstance(found, str):
        print(f"LeRobot cannot be asked: {found}", file=sys.stderr)
        return 1
    print(json.dumps(found, indent=2))
    return 0 if is_right(found) else 1


def is_right(found: dict[str, Any]) -> bool:
    """Return whether states are exact, and each picture is the one of its frame."""
    pictures = [
        each["largest_mean_difference"] < MAX_DIFFERENCE and each["nearest"] == each["compared"]
        for each in found["pictures"].values()
    ]
    return found["state_error"] == found["action_error"] == 0.0 and all(pictures)


if __name__ == "__main__":
    sys.exit(main())
