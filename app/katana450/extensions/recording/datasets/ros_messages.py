"""Messages of ROS 2 in CDR, the form in which bags hold them, and their definitions.

Only the few types that recordings need are known. All numbers are little-endian, and each is
aligned to its own size from the end of the header on.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from katana450.maths.geometry.arrays import FloatArray

NANO = 1_000_000_000

JOINT_STATE: Final = "sensor_msgs/msg/JointState"
TF_MESSAGE: Final = "tf2_msgs/msg/TFMessage"
TEXT: Final = "std_msgs/msg/String"

FIELDS: Final[Mapping[str, str]] = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/String": "string data\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort\n"
    ),
}
"""Fields of each type."""

PARTS: Final[Mapping[str, tuple[str, ...]]] = {
    TEXT: (),
    JOINT_STATE: ("std_msgs/Header", "builtin_interfaces/Time"),
    TF_MESSAGE: (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
    ),
}
"""Types of which each message consists."""

SEPARATOR = "=" * 80
HEADER = b"\x00\x01\x00\x00"
"""Header of CDR with little-endian numbers."""


def definition(kind: str) -> bytes:
    """Return the definition of the type ``kind`` with all its parts, as bags hold it."""
    text = FIELDS[kind.replace("/msg/", "/")]
    for part in PARTS[kind]:
        text += f"{SEPARATOR}\nMSG: {part}\n{FIELDS[part]}"
    return text.encode()


class Transform(NamedTuple):
    """The pose of a frame in its parent.

    Attributes:
        parent, child: names of the frames.
        position: x, y, z [m].
        rotation: unit quaternion x, y, z, w.
    """

    parent: str
    child: str
    position: Sequence[float]
    rotation: Sequence[float]


class CdrWriter:
    """Writes the fields of one message."""

    def __init__(self) -> None:
        self._data = bytearray()

    @property
    def message(self) -> bytes:
        """The message."""
        return HEADER + bytes(self._data)

    def stamp(self, t: int) -> None:
        """Write the time ``t`` [ns]."""
        seconds, rest = divmod(t, NANO)
        self._align(4)
        self._data += struct.pack("<iI", seconds, rest)

    def text(self, text: str) -> None:
        """Write ``text``."""
        data = text.encode() + b"\0"
        self.count(len(data))
        self._data += data

    def count(self, count: int) -> None:
        """Write the length of a sequence."""
        self._align(4)
        self._data += struct.pack("<I", count)

    def numbers(self, values: Sequence[float]) -> None:
        """Write ``values``, without their count."""
        if len(values):
            self._align(8)
            self._data += struct.pack(f"<{len(values)}d", *values)

    def header(self, t: int, frame: str) -> None:
        """Write the header of a message at ``t`` [ns] in ``frame``."""
        self.stamp(t)
        self.text(frame)

    def _align(self, size: int) -> None:
        self._data += bytes(-len(self._data) % size)


def joint_state(
    t: int, position: Mapping[str, float], velocity: FloatArray | Sequence[float] = ()
) -> bytes:
    """Return a message of joints.

    Args:
        t: time [ns] since the epoch.
        position: values of the joints by their names [rad or m].
        velocity: their rates [rad/s or m/s]; empty if they are not known.
    """
    writer = CdrWriter()
    writer.header(t, "")
    writer.count(len(position))
    for name in position:
        writer.text(name)
    for values in (list(position.values()), [float(each) for each in velocity], []):
        writer.count(len(values))
        writer.numbers(values)
    return writer.message


def transforms(t: int, poses: Sequence[Transform]) -> bytes:
    """Return a message of ``poses`` at ``t`` [ns] since the epoch."""
    writer = CdrWriter()
    writer.count(len(poses))
    for pose in poses:
        writer.header(t, pose.parent)
        writer.text(pose.child)
        writer.numbers([float(each) for each in pose.position])
        writer.numbers([float(each) for each in pose.rotation])
    return writer.message


def text_message(text: str) -> bytes:
    """Return a message with ``text``."""
    writer = CdrWriter()
    writer.text(text)
    return writer.message
