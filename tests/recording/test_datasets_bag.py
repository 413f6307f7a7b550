"""Bags of ROS 2, read by rosbags, a program of others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from katana450.arm.runtime.tick import TickRecord
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.datasets.recorded_robot import recorded_robot
from katana450.extensions.recording.datasets.ros_bag import TOPICS, write_bag
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.messages import EVENTS, STATE
from katana450.maths.geometry import so3
from katana450.resources import URDF_PATH
from tests.recording.recorded import described


@pytest.fixture(scope="module")
def bag(run: Path) -> Path:
    out = run.with_name("bag")
    assert main(["record", "export", str(run), "--format", "rosbag2", "--out", str(out)]) == 0
    return out


def messages_of(bag: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return time [ns] and content of all messages by topic, as rosbags reads them."""
    messages: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([bag]) as reader:
        for connection, t, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            messages.setdefault(connection.topic, []).append((t, message))
    return messages


def test_rosbags_reads_every_message(bag: Path, run: Path, records: list[TickRecord]) -> None:
    messages = messages_of(bag)
    by_time = {round(1e9 * record.state.t): record.state for record in records}
    with RecordingFile.open(run) as file:
        counts, offset = file.counts(), int(file.metadata["utc_offset_ns"])
    assert len(messages["/joint_states"]) == len(messages["/joint_setpoints"]) == counts[STATE]
    assert len(messages["/katana450/events"]) == counts[EVENTS] == 2
    robot = described().robot
    for t, message in messages["/joint_states"]:
        assert 1_000_000_000 * message.header.stamp.sec + message.header.stamp.nanosec == t
        state = by_time[t - offset]
        values = robot.joint_values(state.q, state.gripper)
        assert dict(zip(message.name, message.position, strict=True)) == values
    for t, message in messages["/joint_setpoints"]:
        state = by_time[t - offset]
        assert message.position.tolist() == [*state.setpoint, state.gripper_setpoint]
    ((_, text),) = messages["/robot_description"]
    assert text.data == URDF_PATH.read_text()
    assert json.loads(messages["/katana450/events"][0][1].data)["number"] == 100


def test_frames_place_the_links_and_objects(bag: Path, records: list[TickRecord]) -> None:
    messages = messages_of(bag)
    robot, state = described().robot, records[0].state
    ((_, fixed),) = messages["/tf_static"]
    poses: dict[str, tuple[str, np.ndarray[Any, Any]]] = {}
    for transform in (*fixed.transforms, *messages["/tf"][0][1].transforms):
        part, turned = transform.transform.translation, transform.transform.rotation
        T = np.eye(4)
        T[:3, :3] = so3.from_quaternion(np.array([turned.w, turned.x, turned.y, turned.z]))
        T[:3, 3] = part.x, part.y, part.z
        poses[transform.child_frame_id] = (transform.header.frame_id, T)
    frames = robot.frames(robot.joint_values(state.q, state.gripper))
    assert {link.name for link in robot.links[1:]} | {"object/cup", "object/basin"} == set(poses)
    for link in robot.links[1:]:
        T, name = np.eye(4), link.name
        while name in poses:
            name, step = poses[name]
            T = step @ T
        np.testing.assert_allclose(T, frames[link.name], atol=2e-5)
    times = [t for t, _ in messages["/tf"]]
    assert min(np.diff(times)) >= 50_000_000 * 0.999


def test_description_names_the_content(bag: Path) -> None:
    content = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (content["version"], content["storage_identifier"]) == (8, "mcap")
    (name,) = content["relative_file_paths"]
    counts: dict[str, int] = {}
    with (bag / name).open("rb") as opened:
        reader = make_reader(opened)
        assert reader.get_header().profile == "ros2"
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            assert schema.name == TOPICS[channel.topic]
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            begin = content["starting_time"]["nanoseconds_since_epoch"]
            assert 0 <= message.log_time - begin <= content["duration"]["nanoseconds"]
    topics = content["topics_with_message_count"]
    assert {topic["topic_metadata"]["name"]: topic["message_count"] for topic in topics} == counts
    assert content["message_count"] == sum(counts.values())
    latched = {
        topic["topic_metadata"]["name"]
        for topic in topics
        if "durability: 1" in topic["topic_metadata"]["offered_qos_profiles"]
    }
    assert latched == {"/tf_static", "/robot_description"}


def test_part_begins_with_the_state_at_its_begin(
    run: Path, records: list[TickRecord], tmp_path: Path
) -> None:
    t = records[150].t
    with RecordingFile.open(run) as file:
        write_bag(file, tmp_path / "part", t + 0.002, records[180].t)
        robot = recorded_robot(file)
        with pytest.raises(InputError, match="exists already"):
            write_bag(file, tmp_path / "part")
        offset = int(file.metadata["utc_offset_ns"])
    messages = messages_of(tmp_path / "part")
    first, message = messages["/joint_states"][0]
    assert first - offset == pytest.approx(1e9 * (t + 0.002), abs=1e3)
    state = records[150].state
    assert dict(zip(message.name, message.position, strict=True)) == robot.joint_values(
        state.q, state.gripper
    )
    objects = [transform.child_frame_id for transform in messages["/tf"][0][1].transforms]
    assert {f"object/{prop.name}" for prop in state.objects} <= set(objects)
