"""``katana450 record again``: drive an arm along a recorded motion."""

from __future__ import annotations

import tempfile
from argparse import Namespace
from pathlib import Path

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.assembly.robot_session import DescribedRobot
from katana450.atomic import write_files, writer_of
from katana450.cli.main import main
from katana450.client import Client, connect
from katana450.client.files import LostError
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode_folder import shown_part
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import session_for
from katana450.extensions.recording.run_again.again_script import again_script, read_part
from katana450.server.api import answers

SAME = 1e-9
"""[rad or m] Largest difference of the numbers of one arm."""


def again(options: Namespace) -> int:
    """Run ``katana450 record again`` and return the exit status. Raises KatanaError."""
    with RecordingFile.open(options.file) as file:
        robot = session_for(file, options.urdf)
        text = script_of_part(file, robot, options.start, options.end)
    if options.out is not None:
        write_files({options.out: writer_of(text.encode())})
        print(f"Script: {options.out}")
        return 0
    try:
        with connect(options.url, "Look", options.token) as client:
            check_same_arm(client, robot.session.require_arm(), options.file)
    except LostError:
        # `katana450 run` starts a server, or reports that there is none.
        pass
    with tempfile.TemporaryDirectory(prefix="katana450-") as folder:
        script = Path(folder) / "again.yaml"
        script.write_text(text, encoding="utf-8")
        command = ["run", str(script), "--url", options.url, "--speed", str(options.speed)]
        return main(command + (["--token", options.token] if options.token else []))


def script_of_part(
    file: RecordingFile, robot: DescribedRobot, start: float | None, end: float | None
) -> str:
    """Return the script of the part of ``file`` from ``start`` to ``end`` [s] after its start.

    None: see ``shown_part``. Raises InputError as ``read_part`` and ``again_script``.
    """
    part = read_part(file, *shown_part(file, start, end), name=file.path.name)
    return again_script(part, robot.session.require_arm().gripper, bare=file.settings.bare)


def check_same_arm(client: Client, arm: ArmModel, file: Path) -> None:
    """Raise InputError if the arm of the server is not ``arm``, that of the recording ``file``."""
    other_arm = client.query(answers.Arm)
    pairs = [(other_arm.lower, arm.chain.lower), (other_arm.upper, arm.chain.upper)]
    for one, other in (
        *((np.array(row), own) for row, own in pairs),
        *((np.array(other_arm.tools.get(name, [])), M) for name, M in arm.tools.items()),
    ):
        if one.shape != other.shape or not np.allclose(one, other, 0.0, SAME):
            raise InputError(
                f"{file} is not a recording of {other_arm.name}, the arm of the server: its joint "
                "limits or tool frames differ."
            )
