"""Pictures in datasets, films and pages of recordings, and exports that are killed."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from katana450.arm.robot.props import load_props
from katana450.cli.main import main
from katana450.extensions.media.options import CAMERAS
from katana450.extensions.media.stage import RenderStage, Shot
from katana450.extensions.recording.datasets.lerobot_export import EpisodeVideo
from katana450.extensions.recording.datasets.lerobot_writer import QUANTILES, PixelCounts
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import RecordedStates
from katana450.extensions.recording.options import VIEWS
from tests.media.test_files import HEIGHT, WIDTH, decoded, frames
from tests.recording.dataset_files import episode_folder
from tests.recording.lerobot_check import check_dataset, episodes_of
from tests.recording.recorded import described, swinging

SIZE = (64, 48)
FPS = 5
OWN = Path("/proc/self").exists()


def test_video_has_the_episodes_one_after_another(tmp_path: Path) -> None:
    video = EpisodeVideo(tmp_path, "observation.images.top", (WIDTH, HEIGHT), 10)
    rows, pictures = [], []
    for count in (4, 7):
        for picture in frames(count):
            video.add(picture)
            pictures.append(picture)
        row, _ = video.end_episode()
        rows.append({name.rpartition("/")[2]: value for name, value in row.items()})
    video.encoder.finish()
    place = {"chunk_index": 0, "file_index": 0}
    assert rows == [
        {**place, "from_timestamp": 0.0, "to_timestamp": 0.4},
        {**place, "from_timestamp": 0.4, "to_timestamp": 1.1},
    ]
    path = tmp_path / "videos/observation.images.top/chunk-000/file-000.mp4"
    shown, _ = decoded(path)
    assert shown.shape == (11, HEIGHT, WIDTH, 3)
    # Half of the resolution of colours is lost by the encoding, at the edges of the bar.
    assert np.abs(shown.astype(int) - np.array(pictures)).mean() < 3.0


def test_views_are_those_of_pictures() -> None:
    assert VIEWS == CAMERAS


def test_statistics_of_pictures_are_those_of_all_pixels() -> None:
    rng = np.random.default_rng(3)
    pictures = rng.integers(0, 200, (5, 6, 8, 3), dtype=np.uint8)
    pictures[:, :, :, 1] //= 3
    counts, other = PixelCounts(), PixelCounts()
    for picture in pictures[:3]:
        counts.add(picture)
    for picture in pictures[3:]:
        other.add(picture)
    counts.merge(other)
    row, pixels = counts.statistics, pictures.reshape(-1, 3) / 255.0
    for name, value in {
        "min": pixels.min(axis=0),
        "max": pixels.max(axis=0),
        "mean": pixels.mean(axis=0),
        "std": pixels.std(axis=0),
        **{
            name: np.quantile(pixels, fraction, axis=0, method="inverted_cdf")
            for name, fraction in QUANTILES.items()
        },
    }.items():
        np.testing.assert_allclose(np.array(row[name]).reshape(3), value, atol=1e-12)
    assert row["count"] == [5]


@pytest.mark.long
def test_pictures_show_the_states(tmp_path: Path) -> None:
    folder, out = tmp_path / "episodes", tmp_path / "set"
    episode_folder(folder, {"success": 3, "failure": 4}, swinging)
    views = ("--view", "free", "--view", "tool", "--size", "64x48", "--fps", str(FPS))
    words = ("record", "export", str(folder), "--format", "lerobot", *views, "--out", str(out))
    assert main(list(words)) == 0
    info = check_dataset(out)
    assert info["features"]["observation.images.tool"]["shape"] == [48, 64, 3]
    robot, session, _ = described()
    stage = RenderStage(robot, session, load_props())
    expected: dict[str, list[npt.NDArray[np.uint8]]] = {"free": [], "tool": []}
    for number, row in enumerate(episodes_of(out), start=1):
        with RecordingFile.open(folder / f"episode-{number:04d}.mcap") as file:
            times = file.start + 0.25 + np.arange(row["length"]) / FPS
            for state in RecordedStates(file, session).at(times):
                for view, pictures in expected.items():
                    shot = Shot(view, SIZE)
                    pictures.append(shot.taken(stage, robot, state))
    for view, pictures in expected.items():
        feature = f"observation.images.{view}"
        shown, _ = decoded(out / f"videos/{feature}/chunk-000/file-000.mp4", SIZE)
        assert len(shown) == info["total_frames"] == len(pictures)
        for number, picture in enumerate(pictures):
            distances = np.abs(shown.astype(int) - picture).mean(axis=(1, 2, 3))
            assert distances[number] < 4.0
            assert distances[number] == distances[max(number - 2, 0) : number + 3].min()
        stats = json.loads((out / "meta" / "stats.json").read_text())[feature]
        mean = np.mean(pictures, axis=(0, 1, 2)) / 255.0
        np.testing.assert_allclose(np.array(stats["mean"]).reshape(3), mean, atol=1e-12)


@pytest.mark.long
def test_film_of_a_part(run: Path, tmp_path: Path) -> None:
    film = tmp_path / "run.mp4"
    part = ("--from", "0.2", "--to", "1.2")
    look = ("--view", "side", "--size", "64x48", "--fps", str(FPS))
    words = ["record", "export", str(run), *part]
    assert main([*words, "--format", "mp4", *look, "--out", str(film)]) == 0
    assert decoded(film, SIZE)[0].shape == (6, 48, 64, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["run.mp4"]


def begun(files: list[Path], out: Path, *words: str) -> subprocess.Popen[str]:
    """Start an export and wait until it writes."""
    command = [sys.executable, "-m", "katana450", "record", "export", *map(str, files)]
    process = subprocess.Popen(
        [*command, "--format", "lerobot", "--task", "x", "--out", str(out), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 120.0
    while not list(out.parent.glob(f".{out.name}.*")):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < until
        time.sleep(0.01)
    return process


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "number", [1, *(pytest.param(n, marks=pytest.mark.long) for n in range(2, 12))]
)
def test_killed_export_leaves_no_dataset(run: Path, tmp_path: Path, number: int) -> None:
    out = tmp_path / "set"
    process = begun([run] * 100, out)
    time.sleep(0.3 * random.Random(number).random())
    process.kill()
    process.communicate(timeout=60)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(".set.")
    words = ["record", "export", str(run), "--format", "lerobot", "--task", "x", "--out", str(out)]
    assert main(words) == 0
    check_dataset(out)


def descendants(pid: int) -> set[int]:
    """Return the processes that the process ``pid`` has started, and those that they have."""
    children_found = set()
    for children in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, children.read_text().split()):
            children_found |= {child, *descendants(child)}
    return children_found


def running(pid: int) -> bool:
    """Return whether the process ``pid`` runs, and has not only not been waited for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.long
@pytest.mark.skipif(not OWN, reason="finds processes by /proc")
@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_processes_that_render_end_with_a_killed_export(
    run: Path, tmp_path: Path, sent: signal.Signals
) -> None:
    out = tmp_path / "set"
    process = begun([run], out, "--view", "free", "--size", "320x240")
    until = time.monotonic() + 120.0
    while not list(out.parent.glob(f".{out.name}.*/videos/*/*/*.mp4")):
        assert time.monotonic() < until
        time.sleep(0.05)
    started = descendants(process.pid)
    assert len(started) >= 2
    os.kill(process.pid, sent)
    process.communicate(timeout=60)
    until = time.monotonic() + 20.0
    while any(map(running, started)):
        assert time.monotonic() < until
        time.sleep(0.05)
    assert not out.exists()
    if sent == signal.SIGINT:
        assert list(tmp_path.iterdir()) == []
