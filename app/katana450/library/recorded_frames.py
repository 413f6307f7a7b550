"""The states of a recording as they are drawn: joints, fingers, and where the objects are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from katana450.arm.control.state import State
from katana450.assembly.robot_session import DescribedRobot
from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import MOMENT, TickReader
from katana450.extensions.recording.files.table import rows_from
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    PLANS,
    SOLIDS,
    StateRow,
)
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.maths.geometry.arrays import finite_array, frozen
from katana450.maths.motion.limiter import JointMotion

MIN_STEP = 0.016
"""[s] Minimum time between two frames."""


class RecordedFrames:
    """Frames of a part of a recording, without water.

    Attributes:
        t: (N,) times since the start of the part [s].
        points: (N, 3) the tool point in the base frame [m].
    """

    def __init__(self, path: Path, robot: DescribedRobot, start: float, end: float) -> None:
        """Read the part from ``start`` to ``end`` [s] after the start of the recording.

        Raises InputError for a part without states, a robot without a tool, and a damaged file.
        """
        with RecordingFile.open(path) as file:
            first, last = file.start + start, min(file.start + end, file.end)
            self._standing = _first_state(file)
            self._offset = file.utc_offset + MOMENT
            rows = list(rows_from(file, first, last))
        if not rows or any(row.position is None for row in rows):
            raise InputError(f"{path} has no states of an arm with a tool in that part.")
        frames: list[StateRow] = []
        for row in rows:
            if not frames or row is rows[-1] or row.t >= frames[-1].t + MIN_STEP:
                frames.append(row)
        self._times = [row.t for row in frames]
        self.points = frozen([row.position for row in frames])  # type: ignore[arg-type]
        self.t = frozen([row.t - first for row in frames])
        self._path, self._n = path, len(robot.session.ready)
        self._run = PlaybackRun(lambda: [path])
        self._run.update()

    def state(self, number: int) -> State:
        """Return the state of the frame ``number``, to be drawn. Raises InputError."""
        moment = self._run.at(self._times[number] + self._offset)
        assert moment is not None
        row = moment.row
        q = finite_array(row.joints, (self._n,), f"The joints in {self._path}")
        return replace(
            self._standing, q=q, motion=JointMotion.rest(q), goal=q, gripper=row.gripper,
            gripper_setpoint=row.gripper, objects=moment.objects, poured=None, grip=None,
        )  # fmt: skip


def _first_state(file: RecordingFile) -> State:
    """Return the first complete state."""
    reader = TickReader()
    for message in file.messages(PLANS, SOLIDS):
        reader.add_shared(message)
    for message in file.messages(CHECKPOINTS):
        return reader.checkpoint(message)
    raise InputError(f"{file.path} has no complete state.")
