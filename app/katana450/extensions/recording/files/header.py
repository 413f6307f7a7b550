"""The beginning of a recording: what it is of, what made it, and the files that belong to it."""

from __future__ import annotations

import hashlib
import logging
import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import msgspec

from katana450.arm.control.environment import Environment
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.recording.files.fingerprint import fingerprint
from katana450.settings import Settings

METADATA: Final = "katana450"
"""Name of the metadata record."""

FORMAT: Final = "1"
"""Version of the format of recordings."""

URDF_MEDIA_TYPE = "application/xml"

MAX_SCENE_BYTES = 1_000_000
"""Size up to which the file of a scene is attached to each file of a ring."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Attachment:
    """A file that belongs to a recording: its name, its media type and its content.

    ``log_time``: the time to which it belongs [ns], if it does not belong to all.
    """

    name: str
    media_type: str
    data: bytes
    log_time: int = 0


def attached_scene(path: Path) -> tuple[Attachment, ...]:
    """Return the file of the initial scene at ``path``; nothing if it is large or unreadable.

    All its objects are in the complete states too.
    """
    try:
        size = path.stat().st_size
        if size > MAX_SCENE_BYTES:
            log.warning("%s is not attached to the recording: it has %d bytes.", path, size)
            return ()
        kind = "application/zip" if path.suffix == ".zip" else "application/yaml"
        return (Attachment(path.name, kind, path.read_bytes()),)
    except OSError as error:
        log.warning("%s is not attached to the recording: %s.", path, error.strerror or error)
        return ()


class RecordedSettings(msgspec.Struct, frozen=True):
    """Settings of a recorded session, as its metadata state them.

    Attributes:
        ready: the ready posture [rad or m].
        bare: whether the gripper was taken off the arm.
        rate: ticks per second [Hz].
        tool: the link to which targets refer; None for that of the file.
    """

    ready: tuple[float, ...]
    bare: bool
    rate: float
    tool: str | None


@dataclass(frozen=True, eq=False)
class RecordingHeader:
    """The beginning of a recording.

    Attributes:
        robot: the robot.
        environment: gives the poses of objects in the hand; None to leave them out.
        metadata: texts by their names, see ``header_of``.
        attachments: files that belong to it.
        salt: random bytes for the pseudonyms of people; files that are to be joined have the same.
    """

    robot: Robot
    environment: Environment | None
    metadata: Mapping[str, str]
    attachments: tuple[Attachment, ...] = ()
    salt: bytes = field(default_factory=lambda: secrets.token_bytes(16), repr=False)


def header_of(
    robot: Robot,
    settings: Settings,
    urdf: Path,
    tool: str | None = None,
    environment: Environment | None = None,
    attachments: Sequence[Attachment] = (),
) -> RecordingHeader:
    """Return the header of a recording that begins now. Raises InputError without the URDF.

    Args:
        robot: the robot.
        settings: settings of the server.
        urdf: file of the robot, which is attached.
        tool: the link to which targets refer; None for that of the file.
        environment: gives the poses of objects in the hand.
        attachments: further files, such as that of the scene.
    """
    try:
        described = urdf.read_bytes()
    except OSError as error:
        raise InputError(f"{urdf} cannot be read: {error.strerror or error}.") from error
    used = RecordedSettings(tuple(settings.ready), settings.bare, settings.rate, tool)
    metadata = {
        "format": FORMAT,
        "robot": robot.name,
        "urdf": urdf.name,
        "urdf_sha256": hashlib.sha256(described).hexdigest(),
        "settings": msgspec.json.encode(used).decode(),
        # The clock of states begins at an arbitrary time.
        "utc_offset_ns": str(time.time_ns() - time.perf_counter_ns()),
        **fingerprint(),
    }
    first = Attachment(urdf.name, URDF_MEDIA_TYPE, described)
    return RecordingHeader(robot, environment, metadata, (first, *attachments))
