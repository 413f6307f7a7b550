"""The states of a recording as they are drawn: joints, fingers, and where the objects are."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import msgspec

from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.state import State
from katana450.assembly.robot_session import DescribedRobot
from katana450.errors import InputError
from katana450.extensions.recording.files.checking import TickReader
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import rows, state_at
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    PLANS,
    SOLIDS,
    ObjectPose,
    StateMessage,
)
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
            self._forms, self._standing = _forms(file)
            begin = state_at(file, first)
            found = [] if begin is None else [msgspec.structs.replace(begin, t=first)]
            found += [row for row in rows(file, first, last) if not found or row.t > first]
        if not found or any(row.position is None for row in found):
            raise InputError(f"{path} has no states of an arm with a tool in that part.")
        poses: dict[str, ObjectPose] = {}
        self._frames: list[tuple[StateMessage, dict[str, ObjectPose]]] = []
        due = -math.inf
        for number, row in enumerate(found):
            row.move_objects(poses)
            if row.t >= due or number == len(found) - 1:
                self._frames.append((row, dict(poses)))
                due = row.t + MIN_STEP
        self.points = frozen([row.position for row, _ in self._frames])  # type: ignore[arg-type]
        self.t = frozen([row.t - first for row, _ in self._frames])
        self._path = path
        self._n = len(robot.session.ready)

    def state(self, number: int) -> State:
        """Return the state of the frame ``number``, to be drawn. Raises InputError."""
        row, poses = self._frames[number]
        q = finite_array(row.joints, (self._n,), f"The joints in {self._path}")
        objects = tuple(
            replace(self._forms[name], T=frozen(pose.T), held=False, fixed=False)
            for name, pose in poses.items()
            if name in self._forms
        )
        return replace(
            self._standing, q=q, motion=JointMotion.rest(q), goal=q, gripper=row.gripper,
            gripper_setpoint=row.gripper, objects=objects, poured=None, grip=None,
        )  # fmt: skip


def _forms(file: RecordingFile) -> tuple[dict[str, SceneObject], State]:
    """Return the objects of all complete states by name, and the first of these states."""
    reader, forms, standing = TickReader(), {}, None
    for message in file.messages(PLANS, SOLIDS):
        reader.add_shared(message)
    for message in file.messages(CHECKPOINTS):
        state = reader.checkpoint(message)
        standing = standing or state
        forms.update({each.name: each for each in state.objects})
    if standing is None:
        raise InputError(f"{file.path} has no complete state.")
    return forms, standing
