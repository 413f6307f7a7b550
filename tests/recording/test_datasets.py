"""Exports of recordings as LeRobot datasets without pictures."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.lease import CommandChannel
from katana450.arm.runtime.tick import Submission, TickRecord
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.datasets.lerobot_export import sources_at
from katana450.extensions.recording.datasets.lerobot_writer import SOURCES
from katana450.extensions.recording.files.attempts import lasting_spans
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.files.spans import Span, length_of
from katana450.extensions.recording.files.table import (
    TICK,
    RecordedStates,
    columns,
    frame_times,
    sampled,
)
from katana450.extensions.recording.folders import new_folder
from katana450.maths.geometry.arrays import FloatArray
from tests.recording.dataset_files import episode, episode_folder, write_copy
from tests.recording.lerobot_check import check_dataset, episodes_of, rows_of
from tests.recording.recorded import ADA, described, dragging, header, rewound, run

FPS = 25
OUTCOMES = {"success": 3, "failure": 4, "unjudged": 6, "unfinished": 8}


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return episode_folder(tmp_path_factory.mktemp("recorded") / "episodes", OUTCOMES)


def export(*words: str | Path) -> int:
    return main(["record", "export", *map(str, words)])


def refusal(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """Return why an export is refused."""
    capsys.readouterr()
    assert export(*words) == 1
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "library"),
    [("lerobot", "pyarrow"), ("rosbag2", "rosbags")],
)
def test_missing_library_is_reported(
    run: Path,
    tmp_path: Path,
    kind: str,
    library: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == library] or [library]:
        monkeypatch.setitem(sys.modules, name, None)
    why = refusal(capsys, run, "--format", kind, "--task", "x", "--out", tmp_path / "out")
    if kind != "lerobot":
        assert f"{kind} has no --task" in why
        why = refusal(capsys, run, "--format", kind, "--out", tmp_path / "out")
    assert "pip install pyarrow rosbags" in why
    assert not list(tmp_path.iterdir())


def test_folder_of_episodes_is_a_dataset(
    episodes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    assert export(episodes, "--format", "lerobot", "--fps", str(FPS), "--out", out) == 0
    assert "2 episodes (1 successes, 1 failures, 0 not judged)" in capsys.readouterr().out
    info = check_dataset(out)
    assert info["fps"] == FPS
    assert info["features"]["action"]["names"] == [
        *(f"theta{n}.pos" for n in range(1, 6)),
        "gripper.pos",
    ]
    rows = episodes_of(out)
    assert [episode["success"] for episode in rows] == [True, False]
    # The last message of an episode counts.
    assert {episode["tasks"][0] for episode in rows} == {"pour the water"}
    assert [episode["length"] for episode in rows] == [1 + int(0.85 * FPS), 1 + int(0.95 * FPS)]
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_what_a_rewind_left_is_in_no_dataset(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    ends = [state.t for state in rewound(path)]
    with RecordingFile.open(path) as recording:
        begin_t, end = recording.start + 0.05, ends[140]
        spans = lasting_spans(recording, begin_t, end)
        assert spans == (
            Span(begin_t, ends[30] + TICK),
            Span(ends[100], ends[120] + TICK),
            Span(ends[130], end),
        )
        assert lasting_spans(recording, ends[60], ends[90]) == (Span(ends[70], ends[90]),)
        assert lasting_spans(recording, begin_t, ends[170]) == (Span(ends[150], ends[170]),)
    part = ("--from", str(0.05), "--to", str(end - recording.start))
    words = ("--format", "lerobot", "--fps", "100", "--task", "drag")
    assert export(path, *words, *part, "--out", tmp_path / "set") == 0
    frames = np.array(rows_of(tmp_path / "set")["observation.state"])
    assert len(frames) == int(100.0 * length_of(spans) + 1e-6) + 1
    # The arm moves across each cut as it does in any tick.
    speed = described().robot.require_arm().limits.speed
    assert (np.abs(np.diff(frames[:, :5], axis=0)) <= 0.0101 * speed).all()


def test_frames_tell_what_drove_the_arm(tmp_path: Path) -> None:
    path, ticks = tmp_path / "run.mcap", 90
    givers = [replace(ADA, channel=CommandChannel(name)) for name in ("program", "scene", "TCP")]
    times: list[float] = []
    with path.open("wb") as file:
        writer = RecordingWriter(file, header())

        def take(record: TickRecord) -> None:
            giver = givers[3 * len(times) // ticks]
            times.append(record.t)
            named = tuple(Submission(command, giver) for command, _ in record.submissions)
            writer.put(record._replace(submissions=named))

        run(ticks, 1, take, dragging, odd=False)
        writer.close()
    with RecordingFile.open(path) as recording:
        sources = sources_at(recording, np.array(times))
    assert [SOURCES[source] for source in sources[::30]] == ["program", "program", "person"]
    changes = np.flatnonzero(np.diff(sources))
    assert changes == pytest.approx([30, 60], abs=3)


def test_outcomes_are_chosen(episodes: Path, tmp_path: Path) -> None:
    for outcomes, success in {
        "success": [True],
        "failure": [False],
        "unjudged,unfinished,success": [True, None, None],
    }.items():
        out = tmp_path / outcomes
        words = ("--format", "lerobot", "--outcomes", outcomes, "--fps", "10", "--out", out)
        assert export(episodes, *words) == 0
        check_dataset(out)
        assert [episode["success"] for episode in episodes_of(out)] == success


def between(t: FloatArray, values: FloatArray, time: float) -> FloatArray:
    """Return the value at a time: states hold, and change within the tick before the next one."""
    last = int(np.searchsorted(t, time, side="right")) - 1
    if last + 1 == len(t):
        return np.asarray(values[last])
    length = t[last + 1] - t[last]
    begin = t[last] if length < 0.025 else t[last + 1] - 0.01
    place = max((time - begin) / (t[last + 1] - begin), 0.0)
    return np.asarray(values[last] + place * (values[last + 1] - values[last]))


def test_frames_are_the_states_on_the_grid(episodes: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    assert export(episodes, "--format", "lerobot", "--fps", "40", "--out", out) == 0
    rows, states, actions = rows_of(out), [], []
    for number in (1, 2):
        with RecordingFile.open(episodes / f"episode-{number:04d}.mcap") as file:
            begin, end = file.start + 0.25, file.start + 1.0 + 0.1 * number
            table = columns(file)
        q = np.column_stack((table["q"], table["gripper"]))
        setpoint = np.column_stack((table["setpoint"], table["gripper_setpoint"]))
        for t in begin + np.arange(int((end - begin) * 40 + 1e-6) + 1) / 40:
            states.append(between(table["t"], q, t))
            actions.append(between(table["t"], setpoint, min(t + 1 / 40, end)))
    observed, action = np.array(rows["observation.state"]), np.array(rows["action"])
    np.testing.assert_allclose(observed, np.array(states), rtol=0, atol=1e-6)
    np.testing.assert_allclose(action, np.array(actions), rtol=0, atol=1e-6)
    # The arm moves, so actions are ahead of states.
    assert np.abs(action - observed).max() > 1e-3


def test_statistics_are_exact_over_all_frames(episodes: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    words = ("--outcomes", ",".join(OUTCOMES), "--fps", "50", "--out", out)
    assert export(episodes, "--format", "lerobot", *words) == 0
    stats, rows = json.loads((out / "meta" / "stats.json").read_text()), rows_of(out)
    states = np.array(rows["observation.state"])
    row = stats["observation.state"]
    for name, wanted in {
        "q01": np.quantile(states, 0.01, axis=0),
        "q50": np.median(states, axis=0),
        "q99": np.quantile(states, 0.99, axis=0),
        "mean": states.mean(axis=0),
        "std": states.std(axis=0),
        "min": states.min(axis=0),
        "max": states.max(axis=0),
    }.items():
        np.testing.assert_allclose(row[name], wanted, rtol=0, atol=1e-12)
    described_by = episodes_of(out)
    means = np.mean([row["stats/observation.state/q99"] for row in described_by], axis=0)
    assert np.abs(means - row["q99"]).max() > 1e-3
    for one in described_by:
        part = states[one["dataset_from_index"] : one["dataset_to_index"]]
        wanted = np.quantile(part, 0.9, axis=0)
        np.testing.assert_allclose(one["stats/observation.state/q90"], wanted, atol=1e-12)


def test_whole_recording_is_an_episode_with_the_given_task(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    assert "has no task" in refusal(capsys, run, "--format", "lerobot", "--out", out)
    words = ("--format", "lerobot", "--task", " put it\n down ", "--from", "0.5", "--to", "1.5")
    assert export(run, *words, "--out", out) == 0
    check_dataset(out)
    (episode,) = episodes_of(out)
    assert (episode["tasks"], episode["length"], episode["success"]) == (["put it down"], 31, None)


def test_odd_input_is_refused(
    run: Path, episodes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    other = write_copy(run, tmp_path / "other.mcap", metadata={"robot": "another"})
    gap = write_copy(run, tmp_path / "gap.mcap", gap=1.0)
    with RecordingFile.open(run) as file:
        wrong = write_copy(run, tmp_path / "wrong.mcap", [{"number": "one"}])
        short = write_copy(
            run, tmp_path / "short.mcap", [episode(file, 1, "success", part=(0.5, 0.51))]
        )
        far = write_copy(run, tmp_path / "far.mcap", [episode(file, 3, "success", part=(0.5, 1e9))])
        untold = write_copy(run, tmp_path / "untold.mcap", [episode(file, 1, "success", "")])
        judged = write_copy(run, tmp_path / "judged.mcap", [episode(file, 1, "unjudged")])
    out = tmp_path / "set"
    lerobot = ("--format", "lerobot", "--task", "x", "--out", out)
    plain = ("--format", "lerobot", "--out", out)
    before = sorted(tmp_path.iterdir())
    for why, words in {
        "has no episodes": (empty, *lerobot),
        "no episodes with the outcome": (judged, *lerobot),
        "their robot differs": (run, other, *lerobot),
        "7 ticks are missing": (run, gap, *lerobot),
        r"Expected `int`, got `str` - at `$.number`": (wrong, *lerobot),
        "fewer than 2 frames": (short, *lerobot),
        "Episode 1 of": (untold, *plain),
        "Episode 3 of": (far, *lerobot),
        "1 to 100 frames per second, not 0": (run, *lerobot, "--fps", "0"),
        "1 to 100 frames per second, not 101": (run, *lerobot, "--fps", "101"),
        "--from and --to cut recordings": (untold, *lerobot, "--from", "1"),
        "Only lerobot takes several files": (run, other, "--out", out),
        "cut one recording": (run, run, *lerobot, "--to", "1"),
        "cannot be read": (tmp_path / "none.mcap", *lerobot),
        "exists already": (run, *lerobot[:-1], empty),
        "There is no directory": (run, *lerobot[:-1], tmp_path / "x" / "y"),
        "csv has no --view": (run, "--view", "free", "--out", out),
        "mp4 has no --task": (run, "--format", "mp4", "--task", "x", "--out", out),
        "one view, not 2": (
            run, "--format", "mp4", "--view", "top", "--view", "side", "--out", out,
        ),
        "must be even": (run, *lerobot, "--view", "top", "--size", "63x48"),
        "nothing from 900": (run, "--format", "rosbag2", "--out", out, "--from", "900"),
    }.items():  # fmt: skip
        assert why in refusal(capsys, *words)
    assert sorted(tmp_path.iterdir()) == before
    with pytest.raises(SystemExit):
        export(episodes, *lerobot, "--outcomes", "discarded")


def test_folder_appears_complete_or_not_at_all(tmp_path: Path) -> None:
    out = tmp_path / "set"

    def failing(error: BaseException) -> Callable[[], None]:
        def write() -> None:
            with new_folder(out) as folder:
                (folder / "part").write_text("half")
                assert not out.exists()
                raise error

        return write

    with pytest.raises(KeyboardInterrupt):
        failing(KeyboardInterrupt())()
    with pytest.raises(InputError, match="No space left"):
        failing(OSError(28, "No space left on device"))()
    assert list(tmp_path.iterdir()) == []
    with new_folder(out) as folder:
        (folder / "content").write_text("whole")
    assert [path.name for path in out.iterdir()] == ["content"]
    assert list(tmp_path.iterdir()) == [out]


@given(st.floats(0.0, 1e5), st.integers(1, 100), st.integers(0, 400))
@settings(max_examples=30)
def test_frames_lie_on_the_grid(start: float, fps: int, count: int) -> None:
    times = frame_times(start, start + count / fps, fps)
    assert len(times) == count + 1
    np.testing.assert_allclose(times - start, np.arange(count + 1) / fps, rtol=0, atol=1e-9)


def test_state_holds_while_the_arm_rests() -> None:
    t = np.array([0.0, 0.01, 0.02, 3.0, 3.01, 3.01])
    values = np.array([[0.0], [1.0], [2.0], [3.0], [4.0], [5.0]])
    times = np.array([-1.0, 0.0, 0.005, 0.02, 1.5, 2.99, 2.995, 3.0, 3.005, 3.01, 9.0])
    values_then = sampled(t, values, times)[:, 0]
    np.testing.assert_allclose(values_then, [0, 0, 0.5, 2, 2, 2, 2.5, 3, 3.5, 5, 5], atol=1e-9)


def test_states_for_pictures_have_recorded_joints_objects_and_water(
    run: Path, records: list[TickRecord]
) -> None:
    chosen = records[20:200:20]
    with RecordingFile.open(run) as file:
        reader = RecordedStates(file, described().session)
        states = list(reader.at(np.array([record.t for record in chosen])))
    assert reader.unknown == 0
    environment = described().session.environment
    for state, known in zip(states, (record.state for record in chosen), strict=True):
        np.testing.assert_allclose(state.q, known.q, atol=1e-9)
        assert state.gripper == pytest.approx(known.gripper, abs=1e-9)
        assert [prop.name for prop in state.objects] == [prop.name for prop in known.objects]
        for one, other in zip(state.objects, known.objects, strict=True):
            np.testing.assert_allclose(
                environment.pose(one, state.x), environment.pose(other, known.x), atol=1e-9
            )
        assert (state.poured is None) == (known.poured is None)
        if state.poured is not None and known.poured is not None:
            assert state.poured.water.cup.volume == pytest.approx(
                known.poured.water.cup.volume, abs=1e-12
            )
