"""Recordings as bags of ROS 2: a folder that the library ``rosbags`` writes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from heapq import merge
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

import numpy as np

from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.progress import report
from katana450.extensions.recording.datasets.recorded_robot import attached_urdf, recorded_robot
from katana450.extensions.recording.files.pictures import SCHEMA_NAME, jpeg_of
from katana450.extensions.recording.files.recording_file import (
    Message,
    RecordingFile,
    utc_offset_ns,
)
from katana450.extensions.recording.files.script_runs import FOLDER, scripts_in
from katana450.extensions.recording.files.table import LEAST, rows_from
from katana450.extensions.recording.folders import new_folder
from katana450.extensions.recording.messages import (
    CAMERAS,
    EVENTS,
    NANO,
    ObjectPose,
    Pose,
    StateRow,
    nanoseconds,
    pose_of,
)
from katana450.extras import library
from katana450.maths.geometry.arrays import FloatArray, finite_array

JOINT_STATES: Final = "/joint_states"
SETPOINTS: Final = "/joint_setpoints"
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
DESCRIPTION: Final = "/robot_description"
BAG_EVENTS: Final = "/katana450/events"

JOINT_STATE: Final = "sensor_msgs/msg/JointState"
TF_MESSAGE: Final = "tf2_msgs/msg/TFMessage"
TEXT: Final = "std_msgs/msg/String"

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

BAG_VERSION = 8
"""Version of the description: the newest whose quality of service ROS 2 Humble reads too."""

NONE = np.zeros(0)
"""Numbers that are not known."""

Transform = tuple[str, str, Pose]
"""Names of a parent and its child frame, and the pose of the child in the parent."""


def write_bag(
    file: RecordingFile, out: Path, start: float = -math.inf, end: float = math.inf
) -> int:
    """Write the part of ``file`` from ``start`` to ``end`` [s] as the bag ``out``, a new folder.

    The scripts that ran are files in it. Returns the number of messages. Times are those of UTC.
    Raises InputError, and MissingExtraError without rosbags.
    """
    rosbag2 = library("rosbags.rosbag2", "datasets", "Bags of ROS 2")
    robot = recorded_robot(file)
    with new_folder(out) as folder:
        # The files have the name of the folder in which they are written.
        inner = folder / out.name
        writer = rosbag2.Writer(
            inner, version=BAG_VERSION, storage_plugin=rosbag2.StoragePlugin.MCAP
        )
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        with writer:
            bag = _Bag(writer, file, robot)
            bag.add_part(start, end)
            if not bag.counts[JOINT_STATES]:
                raise InputError(f"{file.path} has no states in that time.")
        for path in inner.iterdir():
            path.rename(folder / path.name)
        inner.rmdir()
        for script in scripts_in([file], start, end)[0]:
            if script.name.startswith(FOLDER):
                (folder / FOLDER).mkdir(exist_ok=True)
                (folder / FOLDER / Path(script.name).name).write_bytes(script.data)
    return sum(bag.counts.values())


class _Bag:
    """A bag that is being written."""

    def __init__(self, writer: Any, file: RecordingFile, robot: Robot) -> None:
        typesys = library("rosbags.typesys", "datasets", "Bags of ROS 2")
        self._file, self._robot, self._writer = file, robot, writer
        self._store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        self._offset = utc_offset_ns(file.metadata)
        self._root = robot.links[0].name
        self._objects: dict[str, ObjectPose] = {}
        self._shown: int | None = None
        cameras = {CAMERAS + name: CAMERAS + f"{name}/compressed" for name in file.cameras}
        self._topics = TOPICS | dict.fromkeys(cameras.values(), SCHEMA_NAME)
        self._pictures = cameras
        self.counts = dict.fromkeys(self._topics, 0)
        self._connections = {
            topic: writer.add_connection(
                topic,
                kind,
                typestore=self._store,
                offered_qos_profiles=_latched() if topic in LATCHED else [],
            )
            for topic, kind in self._topics.items()
        }

    def add_part(self, start: float, end: float) -> None:
        """Add all messages from ``start`` to ``end`` [s]."""
        started = False
        begin = max(start, self._file.start)
        states: Iterator[tuple[int, StateRow | Message]] = (
            (nanoseconds(row.t), row) for row in rows_from(self._file, begin, end)
        )
        others = (self._messages(topic, begin, end) for topic in (EVENTS, *self._pictures))
        for log_time, content in merge(states, *others, key=itemgetter(0)):
            t = log_time + self._offset
            if not 0 <= t < MAX_TIME:
                raise InputError(
                    f"{self._file.path} is damaged: its times are not from 1970 to 2038."
                )
            if not started:
                started = True
                urdf = attached_urdf(self._file).data.decode(errors="replace")
                self._add(DESCRIPTION, t, data=urdf)
                self._add(TF_STATIC, t, transforms=self._transforms(t, self._fixed()))
            length = max(self._file.end - self._file.start, LEAST)
            report((log_time / NANO - self._file.start) / length)
            if isinstance(content, StateRow):
                self._add_state(t, content)
            elif content.topic in self._pictures:
                name = content.topic.removeprefix(CAMERAS)
                jpeg = np.frombuffer(jpeg_of(content), np.uint8)
                topic, header = self._pictures[content.topic], self._header(t, name)
                self._add(topic, t, header=header, format="jpeg", data=jpeg)
            else:
                self._add(BAG_EVENTS, t, data=content.data.decode(errors="replace"))

    def _messages(
        self, topic: str, begin: float, end: float
    ) -> Iterator[tuple[int, StateRow | Message]]:
        for message in self._file.messages(topic, start=begin, end=end):
            yield message.log_time, message

    def _add(self, topic: str, t: int, **fields: Any) -> None:
        kind = self._topics[topic]
        message = self._store.types[kind](**fields)
        data = self._store.serialize_cdr(message, kind)
        self._writer.write(self._connections[topic], t, data)
        self.counts[topic] += 1

    def _header(self, t: int, frame: str = "") -> Any:
        types = self._store.types
        stamp = types["builtin_interfaces/msg/Time"](*divmod(t, NANO))
        return types["std_msgs/msg/Header"](stamp, frame)

    def _add_joints(
        self, topic: str, t: int, positions: Mapping[str, float], rates: FloatArray
    ) -> None:
        self._add(
            topic,
            t,
            header=self._header(t),
            name=list(positions),
            position=np.array(list(positions.values())),
            velocity=rates,
            effort=NONE,
        )

    def _add_state(self, t: int, state: StateRow) -> None:
        robot, arm = self._robot, self._robot.arm
        names = robot.driven if arm is None else arm.chain.names
        q, setpoint, qd = (
            finite_array(numbers, (len(names),), f"The joints in {self._file.path}")
            for numbers in (state.joints, state.setpoint, state.qd)
        )
        values = robot.joint_values(q, state.gripper)
        self._add_joints(JOINT_STATES, t, values, NONE)
        target = dict(zip(names, setpoint.tolist(), strict=True))
        if arm is not None:
            driven = [name for name, follows in arm.fingers.items() if follows == (1.0, 0.0)]
            # The rate of the fingers is not recorded, and a message has all rates or none.
            qd = NONE if driven else qd
            target.update(dict.fromkeys(driven[:1], state.gripper_setpoint))
        self._add_joints(SETPOINTS, t, target, qd)
        state.move_objects(self._objects)
        if self._shown is None or t - self._shown >= TF_PERIOD:
            self._shown = t
            moving = [self._link(link, values) for link in robot.links if link.joint is not None]
            objects = [
                (self._root, f"object/{name}", (pose.position, pose.orientation))
                for name, pose in self._objects.items()
            ]
            self._add(TF, t, transforms=self._transforms(t, [*moving, *objects]))

    def _transforms(self, t: int, poses: Iterable[Transform]) -> list[Any]:
        types = self._store.types
        return [
            types["geometry_msgs/msg/TransformStamped"](
                self._header(t, parent),
                child,
                types["geometry_msgs/msg/Transform"](
                    types["geometry_msgs/msg/Vector3"](*position),
                    types["geometry_msgs/msg/Quaternion"](*rotation),
                ),
            )
            for parent, child, (position, rotation) in poses
        ]

    def _fixed(self) -> Iterator[Transform]:
        for link in self._robot.links:
            if link.joint is None and link.parent is not None:
                yield self._link(link, {})

    def _link(self, link: Link, values: Mapping[str, float]) -> Transform:
        T = link.T_parent_link
        if link.joint is not None:
            T = T @ link.joint.motion(values[link.joint.name])
        return link.parent or self._root, link.name, pose_of(np.asarray(T))


def _latched() -> list[Any]:
    """Return the quality of service: keep the last, reliable, for late subscribers too."""
    kinds = library("rosbags.interfaces", "datasets", "Bags of ROS 2")
    forever = kinds.QosTime(9223372036, 854775807)
    return [
        kinds.Qos(
            history=kinds.QosHistory.KEEP_LAST,
            depth=1,
            reliability=kinds.QosReliability.RELIABLE,
            durability=kinds.QosDurability.TRANSIENT_LOCAL,
            deadline=forever,
            lifespan=forever,
            liveliness=kinds.QosLiveliness.AUTOMATIC,
            liveliness_lease_duration=forever,
            avoid_ros_namespace_conventions=False,
        )
    ]
