"""The content of a recording: topics, schemas, seeking, parts, and tables."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import katana450
from katana450.arm.runtime.tick import TickRecord
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.files import recording_writer
from katana450.extensions.recording.files.header import (
    METADATA,
    RELEVANT,
    differences,
    fingerprint,
)
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recording_writer import MessageWriter, RecordingWriter
from katana450.extensions.recording.files.simulation import verify_recording
from katana450.extensions.recording.files.table import columns, state_at
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    COMMANDS,
    EVENTS,
    STATE,
    TOPICS,
)
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from tests.recording.recorded import (
    described,
    header,
    run,
)


@pytest.fixture
def file(run: Path) -> Iterator[RecordingFile]:
    with RecordingFile.open(run) as file:
        yield file


def test_stock_reader_finds_every_message_valid_by_its_schema(
    run: Path, records: list[TickRecord]
) -> None:
    checks = {}
    counts: dict[str, int] = {}
    with run.open("rb") as opened:
        for schema, channel, message in make_reader(opened, validate_crcs=True).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            if schema.name not in checks:
                form = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(form)
                checks[schema.name] = jsonschema.Draft202012Validator(form)
            checks[schema.name].validate(json.loads(message.data))
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    assert counts[COMMANDS] == len(records)
    assert counts[EVENTS] == len(records) // 100


def test_index_is_that_of_the_mcap_library(tmp_path: Path, file: RecordingFile) -> None:
    """Write the same messages by the library's writer, and compare what readers get."""
    copy = tmp_path / "copy.mcap"
    with copy.open("wb") as out:
        writer = Writer(out, chunk_size=2000)
        writer.start("katana450")
        channels = {}
        for topic in TOPICS:
            schema = writer.register_schema(
                topic.schema_name, "jsonschema", json_text(topic.schema)
            )
            channels[topic.name] = writer.register_channel(topic.name, "json", schema)
        writer.add_metadata(METADATA, dict(file.metadata))
        for attachment in file.attachments():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        ours = tmp_path / "ours.mcap"
        with ours.open("wb") as target, pytest.MonkeyPatch.context() as patch:
            patch.setattr(recording_writer, "CHUNK_BYTES", 2000)
            mine = MessageWriter(target, file.metadata, list(file.attachments()))
            for message in file.messages(*file.counts()):
                mine.add(message.topic, message.number, message.log_time, message.data)
                t = message.log_time
                writer.add_message(channels[message.topic], t, message.data, t, message.number)
            mine.finish()
        writer.finish()
    indices = []
    for path in (ours, copy):
        with path.open("rb") as opened:
            summary = make_reader(opened, validate_crcs=True).get_summary()
        assert summary is not None
        for chunk in summary.chunk_indexes:
            # Places in the file differ by the length of the name of the library, and ours are
            # packed better.
            chunk.chunk_start_offset = 0
            chunk.chunk_length -= chunk.compressed_size
            chunk.compressed_size = 0
            first = min(chunk.message_index_offsets.values())
            offsets = chunk.message_index_offsets.items()
            chunk.message_index_offsets = {key: offset - first for key, offset in offsets}
        for attached in summary.attachment_indexes:
            attached.offset = 0
        for metadata in summary.metadata_indexes:
            metadata.offset = 0
        indices.append(vars(summary))
    assert indices[0] == indices[1]
    assert len(indices[0]["chunk_indexes"]) > 10


def test_states_are_the_changed_ones_to_the_bit(
    run: Path, file: RecordingFile, records: list[TickRecord]
) -> None:
    by_time = {record.state.t: record.state for record in records}
    messages = [json.loads(message.data) for message in file.messages(STATE)]
    assert 0.3 * len(records) < len(messages) <= len(records)
    robot = described().robot
    arm = robot.require_arm()
    for row in messages:
        state = by_time[row["t"]]
        assert np.array(row.get("q", row["setpoint"])).tobytes() == state.q.tobytes()
        assert np.array(row["setpoint"]).tobytes() == state.setpoint.tobytes()
        assert row["status"] == state.status.value
        T = arm.T_base_shoulder @ forward(arm.chain_to(state.tool), state.q)
        np.testing.assert_allclose(row["position"], T[:3, 3], atol=2e-5)
    # The orientation is not in the file; it follows from the joints.
    found_orientations = katana450.open(run).orientation
    assert found_orientations.shape == (len(messages), 4)
    for row, (x, y, z, w) in zip(messages[::10], found_orientations[::10], strict=True):
        state = by_time[row["t"]]
        T = arm.T_base_shoulder @ forward(arm.chain_to(state.tool), state.q)
        np.testing.assert_allclose(so3.from_quaternion((w, x, y, z)), T[:3, :3], atol=1e-12)
    # A state holds until the next.
    for tick in records:
        newest = file.last_before(STATE, tick.t)
        assert newest is not None
        assert json.loads(newest.data)["setpoint"] == tick.state.setpoint.tolist()


def test_state_at_any_moment_has_all_objects(
    file: RecordingFile, records: list[TickRecord], run: Path, tmp_path: Path
) -> None:
    part = tmp_path / "part.mcap"
    trim([run], part, records[150].t, records[200].t)
    with RecordingFile.open(part) as cut:
        for number in (0, 3, 149, 150, 175, 200, 210):
            state = records[number].state
            for source in (file, cut):
                known = state_at(source, state.t)
                if source is cut and number > 200:
                    continue
                assert known is not None
                assert known.joints == state.q.tolist()
                assert {one.name for one in known.objects} == {o.name for o in state.objects}
    assert state_at(file, file.start - 1.0) is None


def test_metadata_and_attachments_tell_what_made_it(file: RecordingFile) -> None:
    assert file.metadata.items() >= fingerprint().items()
    assert set(RELEVANT) <= set(file.metadata)
    assert not differences(file.metadata)
    assert differences({**file.metadata, "numpy": "Other"}) == [
        f"numpy: Other there, {file.metadata['numpy']} here"
    ]
    attached = {attachment.name: attachment.data for attachment in file.attachments()}
    assert attached == {"katana450.urdf": URDF_PATH.read_bytes(), "scene.json": b"{}"}


def test_seeking_reads_only_what_is_asked_for(file: RecordingFile) -> None:
    middle = 0.5 * (file.start + file.end)
    message = file.last_before(STATE, middle)
    assert message is not None
    assert file.start <= message.t <= middle
    assert file.last_before(STATE, file.start - 1.0) is None
    assert file.last_before(CHECKPOINTS, file.end) is not None
    part = list(file.messages(COMMANDS, start=middle, end=middle + 0.1))
    assert all(middle <= message.t <= middle + 0.1 for message in part)
    assert 5 <= len(part) <= 12


def test_files_of_a_ring_are_joined(records: list[TickRecord], tmp_path: Path) -> None:
    head, paths = header(), []
    for number in range(3):
        paths.append(tmp_path / f"{number}.mcap")
        with paths[-1].open("wb") as opened:
            writer = RecordingWriter(opened, head)
            for record in records[number * 80 : (number + 1) * 80]:
                writer.put(record)
            writer.close()
    joined = trim(paths[::-1], tmp_path / "whole.mcap", -math.inf, math.inf)
    rest = records[:240]
    assert joined == pytest.approx((rest[0].t, rest[-1].t))
    with RecordingFile.open(tmp_path / "whole.mcap") as whole:
        result = verify_recording(whole, described().session)
        assert str(result) == f"identical to the bit over {len(rest) - 1} ticks"
        # The first tick is not simulated: the complete state is that after it.
        assert whole.counts()[COMMANDS] == len(rest) - 1
    with pytest.raises(InputError, match="There is nothing from"):
        trim(paths, tmp_path / "nothing.mcap", 1.0, 2.0)
    assert not (tmp_path / "nothing.mcap").exists()
    other = tmp_path / "other.mcap"
    with other.open("wb") as opened:
        RecordingWriter(opened, header()).close()
    with pytest.raises(InputError, match="not of one run"):
        trim([*paths, other], tmp_path / "mixed.mcap", -math.inf, math.inf)


def test_csv_is_a_motion_that_export_plays(
    run: Path, records: list[TickRecord], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.csv"
    assert main(["record", "export", str(run), "--out", str(out), "--from", "0.5"]) == 0
    assert "rows" in capsys.readouterr().out
    exported = np.genfromtxt(out, delimiter=",", names=True)
    with RecordingFile.open(run) as file:
        table = columns(file, file.start + 0.5)
    assert len(exported["t"]) == len(table["t"])
    for axis in range(5):
        assert exported[f"theta{axis + 1}"].tobytes() == table["setpoint"][:, axis].tobytes()
    assert records[0].t + 0.4 < table["t"][0]


def chunked(path: Path, records: list[TickRecord], *, ended: bool) -> bytes:
    """Write three chunks of 20 ticks to ``path``, with an end or without; return its content."""
    with path.open("wb") as opened:
        writer = RecordingWriter(opened, header())
        for number in range(3):
            for record in records[20 * number : 20 * number + 20]:
                writer.put(record)
            writer.flush()
        if ended:
            writer.close()
    return path.read_bytes()


def test_file_without_an_end_is_read_as_far_as_it_was_written(
    records: list[TickRecord], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "running.mcap"
    content = chunked(path, records, ended=False)
    with RecordingFile.open(path) as file:
        begins = [chunk.offset for chunk in file.chunks]
        last = file.messages_of(file.chunks[-1], COMMANDS)
    (length,) = struct.unpack_from("<Q", content, begins[-1] + 1)
    # Whole; without the index of its last chunk; with a part of that, or with zeros in its place.
    for data, ticks in (
        (content, 60),
        (content[: begins[-1] + 9 + length], 60),
        (content[: begins[-1] + 100], 40),
        (content[: begins[-1] + 40] + bytes(len(content) - begins[-1] - 40), 40),
        (content + bytes(1000), 60),
    ):
        path.write_bytes(data)
        with RecordingFile.open(path) as file:
            assert file.counts()[COMMANDS] == ticks
            assert verify_recording(file, described().session).ticks == ticks - 1
    assert last[-1].number == 60
    assert main(["record", "info", str(path)]) == 0
    assert "It has no end" in capsys.readouterr().out
    assert main(["record", "trim", str(path), "--out", str(tmp_path / "whole.mcap")]) == 0
    with (tmp_path / "whole.mcap").open("rb") as stream:
        assert make_reader(stream, validate_crcs=True).get_summary() is not None


def test_parts_beside_a_damaged_chunk_are_read(records: list[TickRecord], tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    content = bytearray(chunked(path, records, ended=True))
    with RecordingFile.open(path) as file:
        place, start = file.chunks[2].offset + 200, file.chunks[2].start
    content[place] ^= 255
    path.write_bytes(content)
    with RecordingFile.open(path) as file, pytest.raises(InputError, match="is damaged"):
        verify_recording(file, described().session)
    trim([path], tmp_path / "part.mcap", -math.inf, start - 0.005)
    with RecordingFile.open(tmp_path / "part.mcap") as file:
        assert verify_recording(file, described().session).ticks == 39


def test_recording_of_another_robot_is_refused(
    run: Path, records: list[TickRecord], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    del records
    other = tmp_path / "other.urdf"
    other.write_text(URDF_PATH.read_text() + "<!-- changed -->")
    assert main(["record", "verify", str(run), "--urdf", str(other)]) == 1
    assert "not of" in capsys.readouterr().err


def test_resting_arm_writes_little(tmp_path: Path) -> None:
    path = tmp_path / "rest.mcap"
    with path.open("wb") as opened:
        writer = RecordingWriter(opened, header())
        run(500, 1, writer.put, lambda *_: iter(()), odd=False)
        writer.close()
    with RecordingFile.open(path) as file:
        assert file.counts()[STATE] <= 3
        # The first two, in which it comes to rest; then there is nothing to record.
        assert verify_recording(file, described().session).ticks == 1
        assert file.counts()[COMMANDS] == 2
