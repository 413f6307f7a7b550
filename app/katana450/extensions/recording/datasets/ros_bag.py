"""Recordings as bags of ROS 2: an MCAP file with CDR messages, and its description."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import yaml
from mcap.writer import CompressionType, Writer

from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.cli.version import version
from katana450.errors import InputError
from katana450.extensions.progress import report
from katana450.extensions.recording.datasets.new_folder import new_folder
from katana450.extensions.recording.datasets.recorded_robot import attached_urdf, recorded_robot
from katana450.extensions.recording.datasets.ros_messages import (
    JOINT_STATE,
    TEXT,
    TF_MESSAGE,
    Transform,
    definition,
    joint_state,
    text_message,
    transforms,
)
from katana450.extensions.recording.files.checking import state_numbers
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.script_runs import FOLDER, scripts_in
from katana450.extensions.recording.files.table import LEAST
from katana450.extensions.recording.state_message import NANO, pose_of
from katana450.extensions.recording.topics import CHECKPOINTS, EVENTS, STATE
from katana450.maths.geometry.arrays import FloatArray, finite_array

JOINT_STATES: Final = "/joint_states"
SETPOINTS: Final = "/joint_setpoints"
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
DESCRIPTION: Final = "/robot_description"
BAG_EVENTS: Final = "/katana450/events"

TOPICS: Final = {
    JOINT_STATES: JOINT_STATE,
    SETPOINTS: JOINT_STATE,
    TF: TF_MESSAGE,
    TF_STATIC: TF_MESSAGE,
    DESCRIPTION: TEXT,
    BAG_EVENTS: TEXT,
}
"""Topics of a bag and their types."""

LATCHED = (TF_STATIC, DESCRIPTION)
"""Topics whose last message a late subscriber gets too."""

TF_PERIOD = 50_000_000
"""[ns] Minimum time between two messages of moving frames."""

MAX_TIME = 2**31 * NANO
"""[ns] First time that a message of ROS 2 cannot hold."""

BAG_VERSION = 5
"""Version of the description, which every ROS 2 since Humble reads."""

FOREVER: Final = {"sec": 9223372036, "nsec": 854775807}
LATCHED_QOS: Final = [
    {
        "history": 1,
        "depth": 1,
        "reliability": 1,
        "durability": 1,
        "deadline": FOREVER,
        "lifespan": FOREVER,
        "liveliness": 1,
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
]
"""Quality of service of these topics: keep the last, reliable, transient local."""


def write_bag(
    file: RecordingFile, out: Path, start: float = -math.inf, end: float = math.inf
) -> int:
    """Write the part of ``file`` from ``start`` to ``end`` [s] as the bag ``out``, a new folder.

    Returns the number of messages. Times are those of UTC. Raises InputError.
    """
    robot = recorded_robot(file)
    with new_folder(out) as folder:
        name = f"{out.name}_0.mcap"
        with (folder / name).open("wb") as target:
            bag = _Bag(target, file, robot)
            bag.add_part(start, end)
            bag.add_scripts(start, end)
            bag.close()
        if not bag.counts[JOINT_STATES]:
            raise InputError(f"{file.path} has no states in that time.")
        description = yaml.safe_dump(bag.description(name), sort_keys=False)
        (folder / "metadata.yaml").write_text(description, encoding="utf-8")
    return sum(bag.counts.values())


@dataclass
class _Span:
    """First and last time of the messages [ns]; ``shown``: time of the last moving frames."""

    first: int | None = None
    last: int = 0
    shown: int | None = None
    objects: dict[str, Transform] = field(default_factory=dict)


class _Bag:
    """A bag that is being written."""

    def __init__(self, target: BinaryIO, file: RecordingFile, robot: Robot) -> None:
        self._file, self._robot = file, robot
        self._offset = _utc_offset(file)
        self._root = robot.links[0].name
        self._span = _Span()
        self.counts = dict.fromkeys(TOPICS, 0)
        self._writer = Writer(target, compression=CompressionType.ZSTD)
        self._writer.start("ros2", f"katana450 {version()}")
        schemas = {
            kind: self._writer.register_schema(kind, "ros2msg", definition(kind))
            for kind in dict.fromkeys(TOPICS.values())
        }
        self._channels = {
            topic: self._writer.register_channel(
                topic, "cdr", schemas[kind], {"offered_qos_profiles": _qos(topic)}
            )
            for topic, kind in TOPICS.items()
        }

    def add_part(self, start: float, end: float) -> None:
        """Add all messages from ``start`` to ``end`` [s]."""
        begun = False
        for message in self._messages(start, end):
            t = message.log_time + self._offset
            if t >= MAX_TIME:
                raise InputError(f"{self._file.path} is damaged: its times are beyond 2038.")
            if not begun:
                begun = True
                urdf = attached_urdf(self._file).data.decode(errors="replace")
                self._add(DESCRIPTION, t, text_message(urdf))
                self._add(TF_STATIC, t, transforms(t, list(self._fixed())))
            report((message.t - self._file.start) / max(self._file.end - self._file.start, LEAST))
            if message.topic == EVENTS:
                self._add(BAG_EVENTS, t, text_message(message.data.decode(errors="replace")))
            else:
                self._add_state(t, state_numbers(message))

    def add_scripts(self, start: float, end: float) -> None:
        """Attach the scripts that ran from ``start`` to ``end`` [s]."""
        for each in scripts_in([self._file], start, end)[0]:
            if each.name.startswith(FOLDER):
                t = min(max(each.log_time + self._offset, 0), MAX_TIME)
                self._writer.add_attachment(t, t, each.name, each.media_type, each.data)

    def close(self) -> None:
        """Write the index and the end of the file."""
        self._writer.finish()

    def description(self, name: str) -> dict[str, Any]:
        """Return the content of ``metadata.yaml``; ``name``: that of the MCAP file."""
        first = self._span.first or 0
        duration = {"nanoseconds": self._span.last - first}
        starting = {"nanoseconds_since_epoch": first}
        total = sum(self.counts.values())
        topics = [
            {
                "topic_metadata": {
                    "name": topic,
                    "type": kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": _qos(topic),
                },
                "message_count": self.counts[topic],
            }
            for topic, kind in TOPICS.items()
            if self.counts[topic]
        ]
        return {
            "rosbag2_bagfile_information": {
                "version": BAG_VERSION,
                "storage_identifier": "mcap",
                "duration": duration,
                "starting_time": starting,
                "message_count": total,
                "topics_with_message_count": topics,
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [name],
                "files": [
                    {
                        "path": name,
                        "starting_time": starting,
                        "duration": duration,
                        "message_count": total,
                    }
                ],
            }
        }

    def _messages(self, start: float, end: float) -> Iterator[Message]:
        """Yield states and events of the part; the first state is the one at ``start``."""
        file = self._file
        begin = max(start, file.start)
        first = file.last_before(CHECKPOINTS, begin)
        for message in file.messages(STATE, end=begin, start=begin if first is None else first.t):
            self._place_objects(state_numbers(message))
        before = file.last_before(STATE, begin)
        if before is not None:
            yield before._replace(log_time=round(begin * NANO))
        after = begin if before is None else max(begin, before.t)
        for message in file.messages(STATE, EVENTS, start=after, end=end):
            if before is None or message.topic == EVENTS or message.log_time > before.log_time:
                yield message

    def _add(self, topic: str, t: int, data: bytes) -> None:
        self._writer.add_message(self._channels[topic], t, data, t, self.counts[topic])
        self.counts[topic] += 1
        span = self._span
        span.first = t if span.first is None else min(span.first, t)
        span.last = max(span.last, t)

    def _add_state(self, t: int, numbers: dict[str, Any]) -> None:
        q, gripper = self._values(numbers, "q"), self._value(numbers, "gripper")
        values = self._robot.joint_values(q, gripper)
        self._add(JOINT_STATES, t, joint_state(t, values))
        setpoint = self._values(numbers, "setpoint")
        arm = self._robot.arm
        names = self._robot.driven if arm is None else arm.chain.names
        target = dict(zip(names, setpoint.tolist(), strict=True))
        qd = self._values(numbers, "qd").tolist()
        if arm is not None:
            driven = [name for name, follows in arm.fingers.items() if follows == (1.0, 0.0)]
            # The rate of the fingers is not recorded, and a message has all rates or none.
            qd = [] if driven else qd
            target.update({name: self._value(numbers, "gripper_setpoint") for name in driven[:1]})
        self._add(SETPOINTS, t, joint_state(t, target, qd))
        self._place_objects(numbers)
        shown = self._span.shown
        if shown is None or t - shown >= TF_PERIOD:
            self._span.shown = t
            moving = [self._link(link, values) for link in self._robot.links if link.joint]
            self._add(TF, t, transforms(t, [*moving, *self._span.objects.values()]))

    def _place_objects(self, numbers: dict[str, Any]) -> None:
        objects = self._span.objects
        try:
            for each in numbers.get("objects", ()):
                name = str(each["name"])
                position = finite_array(each["position"], (3,), "The position of an object")
                rotation = finite_array(each["orientation"], (4,), "The orientation of an object")
                objects[name] = Transform(
                    self._root, f"object/{name}", position.tolist(), rotation.tolist()
                )
            for name in numbers.get("removed", ()):
                objects.pop(name, None)
        except (TypeError, KeyError) as error:
            raise InputError(f"{self._file.path} is damaged: the objects are wrong.") from error

    def _values(self, numbers: dict[str, Any], name: str) -> FloatArray:
        robot = self._robot
        count = len(robot.driven if robot.arm is None else robot.arm.chain.names)
        return finite_array(numbers.get(name), (count,), f"{name} of {self._file.path}")  # type: ignore[arg-type]

    def _value(self, numbers: dict[str, Any], name: str) -> float:
        value = finite_array([numbers.get(name)], (1,), f"{name} of {self._file.path}")  # type: ignore[arg-type]
        return float(value[0])

    def _fixed(self) -> Iterator[Transform]:
        for link in self._robot.links:
            if link.joint is None and link.parent is not None:
                yield self._link(link, {})

    def _link(self, link: Link, values: dict[str, float]) -> Transform:
        T = link.T_parent_link
        if link.joint is not None:
            T = T @ link.joint.motion(values[link.joint.name])
        position, rotation = pose_of(np.asarray(T))
        return Transform(link.parent or self._root, link.name, position, rotation)


def _utc_offset(file: RecordingFile) -> int:
    """Return what to add to the times of ``file`` for those since the epoch [ns]."""
    text = file.metadata.get("utc_offset_ns", "")
    # ``file.utc_offset`` is a float, which is exact to 0.2 us only.
    return int(text) if text.isdigit() and len(text) < 20 else 0


def _qos(topic: str) -> str:
    return yaml.safe_dump(LATCHED_QOS, sort_keys=False) if topic in LATCHED else ""
