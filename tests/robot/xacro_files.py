"""Robot descriptions in xacro for the tests."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from katana450.assembly.robot_files import read_robot
from katana450.errors import RobotDescriptionError
from tests.robot.public_arms import PX150, urdf
from tests.robot.xacro_forks import run_forked

PACKAGE = Path(__file__).parent / "xacro" / "printed_arm_description"
FILE = PACKAGE / "urdf" / "printed_arm.urdf.xacro"

OPEN = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'

LEAKS = ("Traceback", "<class", "Exception", "NoneType", "object has no attribute")


def templated(folder: Path, *lines: str, name: str = "arm.urdf.xacro") -> Path:
    """Write a xacro file whose second line is the first of ``lines``, with the links of an arm."""
    links = urdf("arm", PX150).partition("\n")[2]
    path = folder / name
    path.write_text(OPEN + "\n".join(lines) + "\n" + links, encoding="utf-8")
    return path


def refusal(path: Path) -> str:
    """Return the message that refuses the file at ``path``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subprocess, "run", run_forked)
        with pytest.raises(RobotDescriptionError) as raised:
            read_robot(path)
    message = str(raised.value)
    assert not any(word in message for word in LEAKS), message
    return message
