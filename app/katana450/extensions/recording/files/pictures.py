"""Pictures of cameras in recordings: messages of ROS 2, which Foxglove and bags take as they are.

A picture has the time of its receipt on the clock of the recording, as all other messages.
Source: ROS 2, sensor_msgs/msg/CompressedImage; OMG, DDS-XTYPES 1.3, 7.4.1 (CDR, little-endian).
"""

from __future__ import annotations

import struct
from typing import Final

from katana450.errors import InputError
from katana450.extensions.cameras.sources import JPEG
from katana450.extensions.recording.files.recording_file import Message
from katana450.extensions.recording.messages import CAMERAS, NANO

ENCODING: Final = "cdr"
SCHEMA_NAME: Final = "sensor_msgs/msg/CompressedImage"
SCHEMA_ENCODING: Final = "ros2msg"
SCHEMA: Final = f"""\
std_msgs/Header header
string format
uint8[] data
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""First bytes of a message."""


def picture_message(camera: str, log_time: int, jpeg: bytes) -> Message:
    """Return the message of the picture ``jpeg``, a JPEG file, at ``log_time`` [ns]."""
    stamp = struct.pack("<iI", *divmod(log_time, NANO))
    data = LITTLE_ENDIAN + stamp + _names(camera) + struct.pack("<I", len(jpeg)) + jpeg
    return Message(CAMERAS + camera, 0, log_time, data)


def jpeg_of(message: Message) -> bytes:
    """Return the JPEG file in the ``message`` of a camera. Raises InputError."""
    camera = message.topic.removeprefix(CAMERAS)
    head = len(LITTLE_ENDIAN) + 8 + len(_names(camera)) + 4
    jpeg = message.data[head:]
    if not jpeg.startswith(JPEG):
        raise InputError(f"The recording is damaged: {message.topic} has a wrong picture.")
    return jpeg


def _names(camera: str) -> bytes:
    """Return the names of the frame and of the format, each padded to whole words."""
    texts = (f"{camera}\0".encode(), b"jpeg\0")
    return b"".join(struct.pack("<I", len(text)) + text + bytes(-len(text) % 4) for text in texts)
