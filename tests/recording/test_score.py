"""Measures of recordings are those of their motions, and the table compares them."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.stop_cause import pressed
from katana450.cli.main import main
from katana450.extensions.media.measures import measurements
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.extensions.recording.episodes.episode import (
    Episode,
    EpisodeGiver,
    EpisodeOutcome,
    message_of,
)
from katana450.extensions.recording.episodes.episode_folder import (
    append_message,
    shown_part,
    with_episode,
    write_episode,
)
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.messages import EPISODES, nanoseconds
from katana450.extensions.recording.scoring import (
    MEASURES,
    RATE,
    Scored,
    dimensionless_jerk,
    score_file,
    scored,
    shown,
    sparc,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
from tests.programs.lagging_driver import LaggingDriver
from tests.recording.recorded import PERIOD, described
from tests.recording.sessions import drag, program, record_session

LINE = "frame: base\ntool: tcp\nsteps:\n  - line: {by: {z: 60}}\n  - gripper: open\n"


def bell(seconds: float) -> FloatArray:
    """Return the velocity (N, 3) [m/s] of a motion of 1 m with minimum jerk."""
    s = np.linspace(0.0, 1.0, round(seconds * RATE) + 1)
    speed = 30.0 * s**2 * (1.0 - s) ** 2 / seconds
    return np.stack((0.6 * speed, 0.0 * speed, 0.8 * speed), axis=1)


def test_smoothness_is_the_known_one_and_falls_with_each_stop() -> None:
    """720 by Hogan and Sternad (2009), -1.41 by Balasubramanian and others (2015)."""
    for seconds in (2.0, 4.0):
        velocity = bell(seconds)
        assert dimensionless_jerk(velocity) == pytest.approx(720.0, rel=0.05)
        assert sparc(np.linalg.norm(velocity, axis=1)) == pytest.approx(-1.41, abs=0.01)
    # The middle half of such a motion, without a step at its ends: 275.6 / 32 / 0.793^2.
    assert dimensionless_jerk(bell(4.0)[100:301]) == pytest.approx(13.7, rel=0.05)
    one = bell(2.0)
    assert dimensionless_jerk(3.0 * one) == pytest.approx(dimensionless_jerk(one), rel=1e-9)
    assert sparc(3.0 * one[:, 0]) == pytest.approx(sparc(one[:, 0]), rel=1e-9)
    two, three = np.concatenate((one, one)), np.concatenate((one, one, one))
    assert dimensionless_jerk(one) < dimensionless_jerk(two) < dimensionless_jerk(three)
    assert sparc(one[:, 0]) > sparc(two[:, 0]) > sparc(three[:, 0])


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("score") / "line.mcap"
    return record_session(path, 260, program(LINE))


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drag with a stop, during which nobody moves the arm for 1.5 s."""
    commands: dict[int, cmd.Command] = {
        90: cmd.Stop(pressed("Ada", "key", "press", 1e9)),
        250: cmd.ClearStop(),
        260: cmd.Position(np.array((0.33, 0.05, 0.08))),
    }
    path = tmp_path_factory.mktemp("score") / "stopped.mcap"
    return record_session(path, 420, drag(90, commands))


def score(path: Path, **options: object) -> Scored:
    with RecordingFile.open(path) as file:
        return scored(file, described(), name=path.name, **options)  # type: ignore[arg-type]


def test_line_has_its_length_and_the_measures_of_the_report(line: Path) -> None:
    result = score(line)
    assert result.values["tool_path_mm"] == pytest.approx(60.0, abs=0.05)
    # One rise and fall of the speed.
    assert result.values["sparc"] == pytest.approx(-1.48, abs=0.02)
    plan = plan_script(parse(LINE), URDF_PATH)
    report = measurements(run_by_clock(plan))
    for name in ("margin_to_limits_deg", "smallest_singular_value", "max_speed_fraction"):
        assert result.values[name] == pytest.approx(report[name], rel=0.02), name
    # Samples find a place that is a little farther away.
    assert result.values["nearest_clearance_mm"] == pytest.approx(
        report["nearest_clearance_mm"], rel=0.15
    )
    assert result.values["stops"] == result.values["contacts"] == 0.0
    assert result.values["emptied_ml"] is None


def test_measured_arm_is_scored_apart_from_its_setpoints(line: Path, tmp_path: Path) -> None:
    """The same line, by an arm that is 70 ms and a known angle behind its setpoints."""
    arm, offset = described().robot.require_arm(), np.array((0.005, 0.0, 0.0, 0.0, 0.0))
    driver = LaggingDriver(arm, described().session.ready, 0.0, 7, offset)
    path = record_session(tmp_path / "measured.mcap", 260, program(LINE), driver)
    exact, result = score(line), score(path)
    for name in ("tool_path_mm", "executed_position_error_mm", "sparc"):
        # The test clock of both runs differs by random fractions of a tick.
        assert result.values[name] == pytest.approx(exact.values[name], rel=1e-3, abs=1e-9), name
    assert (result.values["executed_position_error_mm"] or 1.0) < 1e-9
    assert result.values["tracking_lag_ms"] == pytest.approx(70.0, abs=3.0)
    assert result.values["joint_tracking_error_deg"] == pytest.approx(math.degrees(0.005))
    # 5 mrad about the axis of the base, upwards along which the line leads.
    radius = float(np.linalg.norm(katana450.open(path).position[0, :2]))
    assert result.values["measured_position_error_mm"] == pytest.approx(5.0 * radius, rel=0.01)
    assert exact.values["measured_position_error_mm"] is None


def test_stops_are_counted(stopped: Path) -> None:
    result = score(stopped)
    assert result.values["stops"] == 1.0
    # From the first motion to the last, with the stop.
    assert 3.0 < (result.values["duration_s"] or 0.0) < 8.0
    part = score(stopped, start=0.0, end=0.8)
    assert part.values["stops"] == 0.0
    assert (part.values["sparc"] or 0.0) > (result.values["sparc"] or 0.0)


def test_rest_before_the_first_motion_does_not_count(stopped: Path) -> None:
    """The arm makes no ticks while it stands stopped, so the last state before is old."""
    run = katana450.open(stopped)
    moved = run.t[1:][np.abs(np.diff(run.setpoint, axis=0)).max(axis=1) > 0.0]
    rest = int(np.argmax(np.diff(moved)))
    result = score(stopped, start=float(moved[rest] - run.start + 0.02))
    lasted = moved[-1] - moved[rest + 1] + PERIOD
    assert result.values["duration_s"] == pytest.approx(lasted, abs=1e-6)
    assert (result.values["sparc"] or -9.0) > -1.6


@pytest.mark.long
def test_contacts_are_counted(tmp_path: Path) -> None:
    """The arm waits before the table, below the shoulder by 274.5 mm."""
    commands: dict[int, cmd.Command] = {1: cmd.Position(np.array((0.3, 0.0, -0.4)))}
    result = score(record_session(tmp_path / "table.mcap", 300, drag(0, commands)))
    assert result.values["contacts"] == 1.0
    assert 0.0 < (result.values["nearest_clearance_mm"] or 0.0) < 8.0


@pytest.mark.long
def test_pour_has_the_measures_of_its_report(tmp_path: Path) -> None:
    text = script_text(library_file("pour"))
    result = score(record_session(tmp_path / "pour.mcap", 3700, program(text)))
    plan = plan_script(parse(text), URDF_PATH)
    report = measurements(run_by_clock(plan))
    for name in ("emptied_percent", "spilled_ml", "margin_to_limits_deg"):
        assert result.values[name] == pytest.approx(report[name], rel=0.02, abs=0.01), name
    assert result.values["emptied_ml"] == pytest.approx(199.7, abs=0.3)


def test_trimmed_episode_is_scored_and_run_again_in_its_range(
    line: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "episode-0001.mcap"
    with RecordingFile.open(line) as file:
        begin, end = file.start, file.end
    by = EpisodeGiver("Ada", "operator")
    episode = Episode(1, "lift", begin, end, EpisodeOutcome.SUCCESS, "", by)
    write_episode([line], path, episode)
    whole = score_file(path).values["tool_path_mm"] or 0.0
    assert whole == pytest.approx(score_file(line).values["tool_path_mm"])
    middle = 0.4 * (end - begin)
    with_episode(path, structs.replace(episode, end=begin + middle), "trimmed")
    trimmed = score_file(path).values["tool_path_mm"] or 0.0
    assert 0.0 < trimmed < 0.9 * whole
    assert score_file(path, 0.0, middle).values["tool_path_mm"] == trimmed
    assert score_file(path, 0.0, math.inf).values["tool_path_mm"] == pytest.approx(whole)
    run = katana450.open(path)
    assert run.script() == run.script(0.0, middle)
    script = tmp_path / "again.yaml"
    capsys.readouterr()
    assert main(["record", "again", str(path), "--out", str(script)]) == 0
    assert script.read_text(encoding="utf-8") == run.script()
    # A recording that contains an episode is not the file of that episode.
    with_episode(path, structs.replace(episode, start=begin + 0.1, end=end - 0.1), "trimmed")
    with RecordingFile.open(path) as file:
        assert shown_part(file, None, None) == pytest.approx((0.1, end - begin - 0.1))
    longer = tmp_path / "longer.mcap"
    shutil.copy(line, longer)
    text = json_text(message_of(structs.replace(episode, start=begin + 0.1), end, "ended"))
    append_message(longer, Message(EPISODES, 0, nanoseconds(end), text))
    with RecordingFile.open(longer) as file:
        assert shown_part(file, None, None) == (0.0, math.inf)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (0.0, "0"), (12.3456, "12.35"), (1234.5, "1234"), (-1.4058, "-1.406")],
)
def test_values_have_four_digits(value: float | None, text: str) -> None:
    assert shown(value) == text


def test_command_prints_table_and_json(
    line: Path, stopped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hostile = tmp_path / "<b>&.mcap"
    hostile.write_bytes(stopped.read_bytes())
    assert main(["score", str(hostile), str(line)]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"line\.mcap +<b>&\.mcap", printed), printed
    assert re.search(r"Stops +0 +1\n", printed), printed
    assert "Emptied" not in printed
    assert main(["score", str(line), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["name"] == "line.mcap"
    assert set(MEASURES) <= set(row)
    assert main(["score", str(line), "--from", "100"]) == 1


@pytest.mark.long
def test_library_scores(line: Path) -> None:
    result = katana450.open(line).score()
    assert repr(result).startswith("Scored('line.mcap', duration_s=")
