"""The robot at the start, and a trial of reading another in a disposable process.

``checked_robot`` starts the trial as ``python -m katana450.extensions.robot_choice.robot_check FILE
NAME:=VALUE``. It limits its memory and time, reads the robot as the server will, and writes JSON to
standard output: {"urdf": path}, or {"why": reason}.
"""

from __future__ import annotations

import json
import subprocess
import sys
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import fromstring

from katana450.arm.robot.visual import mesh_file
from katana450.errors import InputError, KatanaError
from katana450.platform_support import hanging_time, limit_resources

FIRST = "first"
"""Name of the robot with which the server began."""

SECONDS = 30.0
"""[s] Maximum processor time of reading a robot."""

MAX_MEMORY_BYTES = 4 << 30
"""[bytes] Maximum memory for reading a robot."""


def first_robot(options: Namespace) -> Path:
    """Return the file of the robot with which the server began, as its ``options`` name it."""
    return Path(getattr(options, "first_urdf", options.urdf))


def checked_robot(path: Path, arguments: Mapping[str, str]) -> Path:
    """Return the URDF file of the robot at ``path``, which the server can drive.

    ``arguments``: values of arguments of a xacro file. Raises InputError with the reason if the
    server could not read it.
    """
    words = [f"{name}:={value}" for name, value in arguments.items()]
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__, str(path.absolute()), *words],
            # The parent folder of the package.
            cwd=Path(__file__).resolve().parents[3],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=hanging_time(SECONDS),
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{path.name} takes too long to read.") from error
    if done.returncode:
        raise InputError(
            f"{path.name} cannot be read: it needs more than {SECONDS:g} s of processor time or "
            f"{MAX_MEMORY_BYTES >> 30} GiB, or a file is corrupt. Try simpler meshes."
        )
    answer: dict[str, str] = json.loads(done.stdout)
    if "why" in answer:
        raise InputError(answer["why"].replace(f"{path.parent}/", ""))
    return Path(answer["urdf"])


def refuse_outside(urdf: bytes, folder: Path, root: Path) -> None:
    """Raise InputError if the description ``urdf`` in ``folder`` names a mesh outside of ``root``.

    A person who gives a robot to the server must not let it open other files.
    """
    for mesh in fromstring(urdf).iter("mesh"):
        name = mesh.get("filename", "")
        if not mesh_file(name, folder).is_relative_to(root.resolve()):
            raise InputError(
                f"The mesh {name!r} is outside of the folder of the robot. Give all meshes with it "
                "in one .zip, named relative to the description or by package://."
            )


def main(path: Path, arguments: Mapping[str, str]) -> None:
    """Read the robot at ``path``, and print the answer."""
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))
    from katana450.assembly.robot_files import read_urdf
    from katana450.assembly.robot_session import find_robot
    from katana450.extensions.robot_choice.uploaded_robots import folder_of
    from katana450.extensions.xacro.xacro_file import expanded_file
    from katana450.settings import Settings

    try:
        urdf, root = expanded_file(path, arguments) if arguments else path, folder_of(path)
        if root is not None:
            refuse_outside(read_urdf(urdf), urdf.parent, root)
        find_robot(Settings(), urdf, None)
    except KatanaError as error:
        print(json.dumps({"why": str(error)}))
    else:
        print(json.dumps({"urdf": str(urdf)}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), dict(word.split(":=", 1) for word in sys.argv[2:]))
