"""The beginning of a recording: what it is of, what made it, and the files that belong to it.

A fingerprint names the machine and the libraries. The same commands give the same bits with the
same libraries, if the process rounds alike on every processor. Otherwise BLAS and libm choose other
code, with another order of rounding.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from katana450.arm.control.objects.environment import Environment
from katana450.arm.robot.robot import Robot
from katana450.atomic import bytes_of
from katana450.cli.version import version
from katana450.portable_rounding import ROUNDS_PORTABLY
from katana450.settings import Settings

DISTANCES = "distances"
"""Entry that tells what measured the distances of bodies. Recordings by coal or FCL have none."""

RELEVANT = ("version", "python", "numpy", DISTANCES, "blas", "libc", "machine", "cpu")
"""Entries that show why a simulation may not give the same bits."""

ROUNDING, PORTABLE = "rounding", "portable"
"""Entry that tells whether the process rounded alike on all x86-64 processors, and its value."""

UNKNOWN = "unknown"


def fingerprint() -> dict[str, str]:
    """Return the versions of program and libraries, and the kind of the processor."""
    return {
        "version": version(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        DISTANCES: f"MuJoCo {metadata.version('mujoco-core')}",
        "blas": _blas(),
        "libc": " ".join(platform.libc_ver()).strip() or UNKNOWN,
        "machine": f"{sys.platform} {platform.machine()}",
        "cpu": _cpu(),
        ROUNDING: PORTABLE if ROUNDS_PORTABLY else "of the processor",
    }


def differences(recorded: Mapping[str, str]) -> list[str]:
    """Return in words what in ``recorded`` differs from this machine, of the relevant entries."""
    present = fingerprint()
    return [
        f"{name}: {recorded.get(name, UNKNOWN)} there, {present[name]} here"
        for name in RELEVANT
        if recorded.get(name, UNKNOWN) != present[name]
    ]


def _blas() -> str:
    config: Any = np.show_config(mode="dicts")
    with suppress(KeyError, TypeError):
        library = config["Build Dependencies"]["blas"]
        return f"{library['name']} {library['version']}"
    return UNKNOWN


def _cpu() -> str:
    with suppress(OSError):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        for line in text.splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or UNKNOWN


METADATA: Final = "katana450"
"""Name of the metadata record."""

FORMAT: Final = "1"
"""Version of the format of recordings."""

URDF_MEDIA_TYPE = "application/xml"


@dataclass(frozen=True)
class Attachment:
    """A file that belongs to a recording: its name, its media type and its content.

    ``log_time``: the time to which it belongs [ns], if it does not belong to all.
    """

    name: str
    media_type: str
    data: bytes
    log_time: int = 0


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
        environment: gives the poses of objects in the hand.
        metadata: texts by their names, see ``header_of``.
        attachments: files that belong to it.
        cameras: names of the cameras whose pictures it may have.
    """

    robot: Robot
    environment: Environment
    metadata: Mapping[str, str]
    attachments: tuple[Attachment, ...] = ()
    cameras: tuple[str, ...] = ()


def header_of(
    robot: Robot,
    settings: Settings,
    urdf: Path,
    tool: str | None,
    environment: Environment,
) -> RecordingHeader:
    """Return the header of a recording that begins now. Raises InputError without the URDF.

    Args:
        robot: the robot.
        settings: settings of the server.
        urdf: file of the robot, which is attached.
        tool: the link to which targets refer; None for that of the file.
        environment: gives the poses of objects in the hand.
    """
    described = bytes_of(urdf)
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
    return RecordingHeader(robot, environment, metadata, (first,))
