"""Verification of a recording with the rounding of the process that recorded it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec

from katana450.errors import InputError
from katana450.extensions.recording.files.checking import session_for, verify_recording
from katana450.extensions.recording.files.fingerprint import PORTABLE, ROUNDING
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.replay import Verification
from katana450.portable_rounding import ROUNDS_PORTABLY, can_round_portably, portable_rounding


def verified(
    path: Path, urdf: Path | None = None, progress: Callable[[float, float], None] | None = None
) -> Verification:
    """Return the comparison of the recording at ``path`` with its simulation.

    The simulation runs in a process of its own if this one rounds otherwise than the server did,
    and this processor has the rounding of the server.

    Args:
        path: file of the recording.
        urdf: file of its robot, if it is not the one of this program.
        progress: called with the simulated time and the whole time [s]; a separate process shows
            its progress itself, on standard error.

    Raises:
        InputError: the file is damaged, or is of another robot.
        RobotDescriptionError: the files of the robot cannot be read.
    """
    with RecordingFile.open(path) as file:
        if simulates_apart(file):
            return _verified_apart(path, urdf, shows=progress is not None)
        start, length = file.start, file.end - file.start
        inner = None if progress is None else lambda t: progress(t - start, length)
        return verify_recording(file, session_for(file, urdf).session, inner)


def simulates_apart(file: RecordingFile) -> bool:
    """Return whether ``file`` is simulated in a process that rounds otherwise than this one."""
    portable = file.metadata.get(ROUNDING) == PORTABLE
    return portable and can_round_portably() and not ROUNDS_PORTABLY


def _verified_apart(path: Path, urdf: Path | None, *, shows: bool) -> Verification:
    # -P: Python does not search the current folder, which may contain an `app.py`.
    command = [sys.executable, "-P", "-m", "katana450", "record", "verify", str(path), "--json"]
    if urdf is not None:
        command += ["--urdf", str(urdf)]
    done = subprocess.run(
        command,
        env=portable_rounding(os.environ),
        stdout=subprocess.PIPE,
        stderr=None if shows else subprocess.PIPE,
        check=False,
    )
    try:
        found = msgspec.json.decode(done.stdout)
        if "error" in found:
            raise InputError(found["error"])
        return msgspec.convert(found, Verification)
    except msgspec.MsgspecError as error:
        text = (done.stderr or b"").decode(errors="replace").strip()
        raise InputError(
            f"The process that simulates {path} ended with status {done.returncode}. {text}"
        ) from error
