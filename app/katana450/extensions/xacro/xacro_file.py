"""Robot descriptions in xacro, the macro language of ROS, as plain URDF."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from argparse import Namespace
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import fromstring

from katana450.arm.robot.description import checked
from katana450.errors import ConfigurationError, RobotDescriptionError
from katana450.extensions.derived_urdf import derived_urdf
from katana450.platform_support import hanging_time

SECONDS = 10.0
"""[s] Maximum processor time of expanding a file."""

MAX_MEMORY_BYTES = 1 << 30
"""[bytes] Maximum memory for expanding a file."""

MAX_BYTES = 20_000_000
"""[bytes] Maximum size of the expanded text."""

READABLE = ("AMENT_", "COLCON_", "CMAKE_PREFIX_PATH", "ROS_")
"""Beginnings of the names of environment variables that a file can read."""

PASSED_ON = (*READABLE, "HOME", "LANG", "LC_", "PATH", "PYTHON", "USERPROFILE")
"""Beginnings of the names of environment variables that the subprocess gets."""


def expanded(path: Path, arguments: Mapping[str, str] | None = None) -> bytes:
    """Return the URDF that the xacro file at ``path`` describes.

    ``arguments``: values of arguments of the file; the others have their defaults.

    A disposable subprocess with limits of time and, where the system supports it, memory expands
    it, because a file can ask for endless work. Its expressions run no other code.

    Raises RobotDescriptionError with the file and, if known, the line at fault.
    """
    system = {"SYSTEMROOT"} if sys.platform == "win32" else set()
    environment = {
        name: value
        for name, value in os.environ.items()
        if name.startswith(PASSED_ON) or name in system
    }
    command = [
        sys.executable,
        "-m",
        "katana450.extensions.xacro.xacro_process",
        str(path.absolute()),
    ]
    command += [f"{name}:={value}" for name, value in (arguments or {}).items()]
    try:
        done = subprocess.run(
            command,
            # The parent folder of the package.
            cwd=Path(__file__).resolve().parents[3],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=hanging_time(SECONDS),
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise _too_large(path) from error
    # A negative code is the signal that ended it, at the limits or for want of memory.
    if done.returncode < 0:
        raise _too_large(path)
    if done.returncode:
        why = done.stderr.decode(errors="replace").strip().rpartition("\n")[2].strip()
        raise RobotDescriptionError(
            f"{path} cannot be expanded: the program that expands xacro did not start: {why}."
        )
    answer = json.loads(done.stdout)
    if "urdf" in answer:
        urdf: bytes = answer["urdf"].encode()
        return urdf
    where = str(path) if answer["file"] is None else f"{path}: {answer['file']}"
    line = "" if answer["line"] is None else f", line {answer['line']}"
    raise RobotDescriptionError(f"{where}{line}: this cannot be expanded: {answer['what']}.")


def expanded_file(path: Path, arguments: Mapping[str, str]) -> Path:
    """Return a file with the URDF that the xacro file at ``path`` describes with ``arguments``.

    Raises RobotDescriptionError, and ConfigurationError for a file that is not in xacro.
    """
    data = checked(path, partial(expanded, arguments=arguments))
    if b"xacro" not in path.read_bytes():
        raise ConfigurationError(f"{path} is not in xacro. Leave --xacro-arg out.")
    return derived_urdf(fromstring(data), path, "xacro")


def _too_large(path: Path) -> RobotDescriptionError:
    return RobotDescriptionError(
        f"{path} cannot be expanded: xacro needs more than {SECONDS:g} s of processor time or "
        f"{MAX_MEMORY_BYTES >> 20} MiB for it. Look for a macro, list or number without end in it."
    )


def expand_with_arguments(options: Namespace) -> None:
    """Expand the file now if there are arguments for it, and name the result in its place."""
    if getattr(options, "xacro_arg", None):
        options.urdf = expanded_file(options.urdf, dict(options.xacro_arg))
