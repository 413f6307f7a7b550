"""`katana450.open`: a recording as arrays, commands and events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.files import simulation
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import recorded_input
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.ticks import Digester, TickInput
from tests.recording.recorded import record
from tests.recording.sessions import drag, record_session

TICKS = 110


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded") / "run.mcap"


@pytest.fixture(scope="module")
def records(path: Path) -> list[TickRecord]:
    return record(path, TICKS, 5)


def test_arrays_are_those_of_the_session(path: Path, records: list[TickRecord]) -> None:
    recording = katana450.open(path)
    by_time = {record.state.t: record.state for record in records}
    states = [by_time[t] for t in recording.t.tolist()]
    assert len(states) > 50
    np.testing.assert_array_equal(recording.q, [state.q for state in states])
    np.testing.assert_array_equal(recording.setpoint, [state.setpoint for state in states])
    np.testing.assert_array_equal(recording.gripper, [state.gripper for state in states])
    np.testing.assert_allclose(recording.qd, [state.motion.qd for state in states], atol=5.1e-5)
    pose = katana450.load(frame="base").fk(recording.q[-1])
    np.testing.assert_allclose(recording.position[-1], pose[:3, 3], atol=5.1e-6)
    np.testing.assert_allclose(np.linalg.norm(recording.orientation, axis=1), 1.0, atol=1e-5)
    assert repr(recording) == f"Recording({str(path)!r}, {recording.end - recording.start:.1f} s)"


def test_commands_and_events_are_listed(path: Path, records: list[TickRecord]) -> None:
    recording = katana450.open(str(path))
    submissions = [(entry.t, sub) for entry in records for sub in entry.submissions]
    assert [type(entry.command) for entry in recording.commands] == [
        type(sub.command) for _, sub in submissions
    ]
    assert [entry.t for entry in recording.commands] == [t for t, _ in submissions]
    assert {entry.giver for entry in recording.commands} == {"Ada", "the server"}
    first = recording.commands[0].command
    assert isinstance(first, cmd.Position)
    assert [entry["number"] for entry in recording.events] == [100]


def test_forks_equal_the_recording_to_the_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, digester = record_session(tmp_path / "drag.mcap", 60, drag(50)), Digester()
    recording = katana450.open(path)
    with RecordingFile.open(path) as file:
        first, *ticks = (
            tick
            for tick in recorded_input(file, file.start, file.end)
            if isinstance(tick, TickInput)
        )
    fork = recording.fork(first.t - recording.start)
    for tick in ticks:
        commands = [submission.command for submission in tick.submissions]
        fork = fork.step(*commands, seconds=tick.t - fork.state.t)
        assert digester.digest(fork.state) == tick.digest
        if tick in ticks[::15]:
            jumped = recording.fork(tick.t - recording.start + 1e-6)
            assert digester.digest(jumped.state) == tick.digest
    other = fork.step(cmd.Home(), seconds=0.3)
    assert other.state.moving
    assert other.state.t == pytest.approx(fork.state.t + 0.3)
    with pytest.raises(katana450.InputError, match="above 0"):
        fork.step(seconds=0.0)
    with pytest.raises(katana450.InputError, match="no moment"):
        recording.fork(9.9)
    # A process that rounds otherwise compares setpoints.
    monkeypatch.setattr(simulation, "simulates_apart", lambda _: True)
    assert digester.digest(recording.fork(0.3).state) != digester.digest(fork.state)
    monkeypatch.setattr(simulation, "SAME", -1.0)
    with pytest.raises(katana450.InputError, match="cannot be simulated exactly"):
        recording.fork(0.3)


def test_part_of_a_recording_begins_where_it_was_cut(
    path: Path, records: list[TickRecord], tmp_path: Path
) -> None:
    part = tmp_path / "part.mcap"
    trim([path], part, records[50].t, records[90].t)
    recording = katana450.open(part)
    assert recording.start == pytest.approx(records[50].t)
    assert recording.t[0] >= records[50].t - 1e-9
    assert recording.commands[0].t >= records[50].t - 1e-9
    assert recording.verify().ticks >= 90 - 1


def test_file_that_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(katana450.InputError, match="cannot be read"):
        katana450.open(tmp_path / "missing.mcap")
