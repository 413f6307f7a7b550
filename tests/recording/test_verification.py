"""A recording is simulated again: identical to the bit, or the first difference is named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import Reason, State
from katana450.arm.control.state.stop_cause import UNNAMED, pressed
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import Submission, TickRecord, stepped
from katana450.assembly.robot_session import find_robot
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.files.header import fingerprint, header_of
from katana450.extensions.recording.files.record_command import same_setpoints
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.files.simulation import verify_recording
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.messages import CHECKPOINTS, COMMANDS
from katana450.extensions.recording.ticks import Difference, Digester, Verification
from katana450.settings import Settings
from tests.conftest import LONG
from tests.recording.dataset_files import write_copy
from tests.recording.recorded import ADA, described, fresh, header, record, run
from tests.recording.sessions import record_session

TICKS = 3000 if LONG else 600
GANTRY = Path(__file__).parents[1] / "exchange" / "gantry.urdf"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded") / "run.mcap"


@pytest.fixture(scope="module")
def records(path: Path) -> list[TickRecord]:
    return record(path, TICKS)


def test_random_session_is_identical_to_the_bit(path: Path, records: list[TickRecord]) -> None:
    kinds = Counter(type(s.command).__name__ for r in records for s in r.submissions)
    assert kinds["Position"] > 40
    assert {"Stop", "ClearStop", "Follow", "ReplaceScene", "Batch"} <= set(kinds), kinds
    assert any(record.failed for record in records)
    assert sum(record.state.following is not None for record in records) > 40
    assert any(r.t_before != b.state.t for b, r in pairwise(records))
    if LONG:
        assert any(f.reason is Reason.CONTACT for r in records for f in r.state.findings)
        assert any(r.state.poured and r.state.poured.water.parcels for r in records)
    with RecordingFile.open(path) as file:
        result = verify_recording(file, fresh().session)
    assert str(result) == f"identical to the bit over {len(records) - 1} ticks"


def test_every_part_is_identical_from_its_first_complete_state(
    path: Path, records: list[TickRecord], tmp_path: Path
) -> None:
    """A new session begins in the middle of drags, plans and pouring."""
    with RecordingFile.open(path) as file:
        starts = [message.t for message in file.messages(CHECKPOINTS)]
    assert len(starts) >= len(records) // 1500 + 1
    for start in starts[1:]:
        part = tmp_path / f"{start}.mcap"
        trim([path], part, start, start + 4.0)
        with RecordingFile.open(part) as file:
            result = verify_recording(file, described().session)
        assert result.identical, result
        assert result.ticks > 50
        assert result.unknown == 0


def test_name_that_comes_after_the_stop_is_simulated(tmp_path: Path) -> None:
    def commands(tick: int, _state: State) -> Iterator[cmd.Command]:
        if tick in {5, 8}:
            # As the process of STOP sends it, and then the server, which knows the name.
            yield cmd.Stop(pressed(UNNAMED if tick == 5 else "Ada", ADA.key, "press", float(tick)))

    path = record_session(tmp_path / "run.mcap", 12, commands)
    with RecordingFile.open(path) as file:
        (named,) = [m for m in file.messages(COMMANDS) if b'"named"' in m.data]
        assert b'"by":"Ada"' in named.data
        assert b"session-of-ada" not in named.data
        assert verify_recording(file, fresh().session) == Verification(5)


def test_identities_of_people_are_not_in_the_file(path: Path, records: list[TickRecord]) -> None:
    del records
    with RecordingFile.open(path) as file:
        data = b"".join(message.data for message in file.messages(COMMANDS, CHECKPOINTS))
    assert b'"name":"Ada"' in data
    assert b"session-of-ada" not in data
    assert b"10.0.0.7" not in data


def write(path: Path, records: list[TickRecord], lost: range = range(0)) -> Path:
    """Write ``records``; those with the numbers ``lost`` are lost."""
    with path.open("wb") as file:
        writer = RecordingWriter(file, header())
        for number, record in enumerate(records):
            if number in lost[-1:]:
                writer.lost(record.t, len(lost), "the disk was full")
            elif number not in lost:
                writer.put(record)
        writer.close()
    return path


def test_changed_command_is_found_at_its_tick(tmp_path: Path) -> None:
    records: list[TickRecord] = []
    goal = described().session.ready + 0.2

    def commands(*_: object) -> Iterator[cmd.Command]:
        if len(records) == 50:
            yield cmd.Joints(goal)
        elif len(records) < 50:
            # An arm at rest makes no records.
            yield cmd.Speed(1.0)

    run(120, 1, records.append, commands)
    changed = cmd.Joints(goal + np.array((0.0, 0.0, 1e-3, 0.0, 0.0)))
    records[50] = records[50]._replace(submissions=[Submission(changed, None)])
    with RecordingFile.open(write(tmp_path / "changed.mcap", records)) as file:
        result = verify_recording(file, described().session)
    assert result.first is not None
    assert result.largest is not None
    assert result.first.t == records[50].t
    assert 0.0 < result.first.size < 1e-6
    assert 1e-4 < result.largest.size <= 1e-3
    assert result.different == 70
    assert str(result).startswith(f"first difference at t = {records[50].t:.3f} s, ")
    assert "; 70 of 119 ticks differ, by up to 0.000" in str(result)


def test_lost_ticks_are_a_gap_and_not_a_difference(
    records: list[TickRecord], tmp_path: Path
) -> None:
    with RecordingFile.open(write(tmp_path / "gap.mcap", records[:400], range(150, 250))) as file:
        result = verify_recording(file, described().session)
    assert result.identical
    assert result.unknown == 100
    assert result.ticks == len(records[:400]) - 100 - 2
    assert str(result).endswith(f"over {result.ticks} ticks; 100 ticks cannot be simulated")


def test_value_without_a_form_is_a_gap(records: list[TickRecord], tmp_path: Path) -> None:
    part = list(records[:60])
    odd = cmd.Tool("\ud800")
    part[30] = part[30]._replace(submissions=[Submission(odd, None)])
    with RecordingFile.open(write(tmp_path / "odd.mcap", part)) as file:
        result = verify_recording(file, described().session)
        text = b"".join(message.data for message in file.messages(COMMANDS))
    assert b"not Unicode" in text
    assert result.identical
    assert result.unknown == 1


def test_mechanism_without_an_arm_is_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gantry = find_robot(Settings(), GANTRY, None)
    assert gantry.robot.arm is None
    path, records = tmp_path / "gantry.mcap", []
    state = gantry.session.begin(gantry.session.ready, 0.0, 10.0)
    for number in range(60):
        orders = [cmd.Joint(1, 0.2)] if number == 5 else []
        before, t = state, 10.0 + 0.01 * (number + 1)
        state = stepped(gantry.session, before, [*orders], t, lambda q, g, *_: DriverAnswer(q, g))
        inputs = [Submission(command, ADA) for command in orders]
        records.append(TickRecord(before.t, t, inputs, False, state))
    with path.open("wb") as file:
        environment = gantry.session.environment
        head = header_of(gantry.robot, Settings(), GANTRY, None, environment)
        writer = RecordingWriter(file, head)
        for record in records:
            writer.put(record)
        writer.close()
    assert main(["record", "verify", str(path), "--urdf", str(GANTRY)]) == 0
    assert "identical to the bit over 59 ticks" in capsys.readouterr().out
    assert main(["record", "verify", str(path)]) == 1
    assert "Name the same URDF" in capsys.readouterr().err
    out = tmp_path / "gantry.csv"
    assert main(["record", "export", str(path), "--out", str(out)]) == 0
    exported = np.genfromtxt(out, delimiter=",", names=True)
    assert exported["theta1"][-1] == state.setpoint[0]
    with pytest.raises(InputError, match="has no position"):
        _ = katana450.open(path).position


def test_digest_sees_every_bit(records: list[TickRecord]) -> None:
    state, digester = records[200].state, Digester()
    digest = digester.digest(state)
    other = np.array(state.goal)
    other[2] = np.nextafter(other[2], 9.0)
    changes = [
        replace(state, t=np.nextafter(state.t, 0.0)),
        replace(state, goal=other),
        replace(state, gripper=-0.0 if repr(state.gripper) == "0.0" else 0.5),
        replace(state, tool="flange"),
        replace(state, objects=state.objects[1:]),
        replace(state, presses=("x",)),
    ]
    digests = {digest, *(digester.digest(change) for change in changes)}
    assert len(digests) == len(changes) + 1
    assert digester.digest(state) == digest == Digester().digest(state)


def test_command_describes_cuts_and_explains(
    path: Path, records: list[TickRecord], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    del records
    part, foreign = tmp_path / "part.mcap", tmp_path / "foreign.mcap"
    assert (
        main(["record", "trim", str(path), "--from", "1", "--to", "2.5", "--out", str(part)]) == 0
    )
    assert "1.5 s." in capsys.readouterr().out
    run = katana450.open(part)
    # The arm rests at the end.
    assert 1.0 < run.end - run.start < 1.52
    assert run.verify().identical
    assert main(["record", "info", str(part)]) == 0
    output = capsys.readouterr().out
    for words in (
        f"{part}: {run.end - run.start:.1f} s from 20",
        "/commands: ",
        "attached: katana450.urdf",
        "numpy: ",
    ):
        assert words in output

    def change(message: Message) -> Message:
        if message.topic != COMMANDS or message.t < run.start + 0.5:
            return message
        return message._replace(data=message.data.replace(b'"digest":"', b'"digest":"0'))

    for metadata, words in (
        ({}, "so the recording was changed"),
        ({"cpu": "Another processor"}, "cpu: Another processor there"),
    ):
        write_copy(part, foreign, metadata=metadata, change=change)
        assert main(["record", "verify", str(foreign)]) == 1
        output = capsys.readouterr().out
        assert "first difference at t = " in output
        assert words in output


@pytest.mark.parametrize(
    ("distances", "size", "same"),
    [(None, 0.0, True), ("coal", 5e-10, True), (None, 1e-8, False), ("", 0.0, False)],
    ids=["none named", "another library", "setpoints differ", "the same library"],
)
def test_recordings_of_another_distance_library_pass_by_their_setpoints(
    distances: str | None, size: float, same: bool
) -> None:
    recorded = fingerprint()
    if distances is None:
        del recorded["distances"]
    elif distances:
        recorded["distances"] = distances
    first = Difference(1.0, size)
    assert same_setpoints(Verification(9, 2, first, first), recorded) is same
    assert not same_setpoints(Verification(9), recorded)
