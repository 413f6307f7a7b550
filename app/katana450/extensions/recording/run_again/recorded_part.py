"""A part of a recording as a motion: setpoints, fingers, and the times at which the arm waited."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.arm.control.state import Status
from katana450.errors import InputError
from katana450.extensions.recording.files.checking import check_whole
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import rows_from
from katana450.extensions.recording.messages import StateRow
from katana450.maths.geometry.arrays import FloatArray, IntArray, finite_array

WAITING = (Status.PAUSED.value, Status.STOPPED.value)
"""Statuses of an arm that somebody has paused or stopped."""

MIN_STEP = 5e-3
"""[s] Minimum time between two states that are used; an extra tick for a STOP comes sooner."""

MIN_GAP, TICK = 0.03, 0.01
"""[s] Time between two states from which on the arm rested between them, and period of ticks."""


@dataclass(frozen=True, eq=False)
class RecordedPart:
    """The N states of a part of a recording.

    Attributes:
        t: (N,) times since the start of the recording [s], rising.
        setpoint: (N, 5) setpoints of the joints [rad].
        fingers: (N,) setpoint of the finger joint [rad or m].
        waiting: (N,) whether the arm was paused or stopped from this state on.
        held: (N,) name of the object between the fingers; "" for none.
        tools: (N,) the tool frame.
        name: name of the file.
    """

    t: FloatArray
    setpoint: FloatArray
    fingers: FloatArray
    waiting: npt.NDArray[np.bool_]
    held: tuple[str, ...]
    tools: tuple[str, ...]
    name: str

    @property
    def rests(self) -> npt.NDArray[np.bool_]:
        """Flags (N - 1,) of the states from which on nothing moves until the next one."""
        moved = np.abs(np.diff(self.setpoint, axis=0)).max(axis=1) > 0.0
        return np.asarray(~(moved | (np.diff(self.fingers) != 0.0)))

    @property
    def waited(self) -> float:
        """The time for which the arm stood paused or stopped [s]."""
        return float(np.diff(self.t)[self.rests & self.waiting[:-1]].sum())

    @property
    def duration(self) -> float:
        """The time from the first motion to the end of the last, without pauses and stops [s]."""
        moving = np.flatnonzero(~self.rests)
        if not len(moving):
            return 0.0
        first, last = int(moving[0]), int(moving[-1]) + 1
        lasted = np.diff(self.t)[first:last]
        left_out = (self.rests & self.waiting[:-1])[first:last]
        return float(lasted[~left_out].sum())


def read_part(
    file: RecordingFile, start: float = 0.0, end: float = math.inf, *, name: str = "recording"
) -> RecordedPart:
    """Return the part of ``file`` from ``start`` to ``end`` [s] after its start.

    Raises InputError for a robot without a tool, a part without motion or with a gap, and a damaged
    file.
    """
    first, last = file.start + start, min(file.start + end, file.end)
    if first >= last:
        raise InputError(
            f"{file.path} is {file.end - file.start:.2f} s long; a part from {start:g} s to "
            f"{end:g} s has nothing of it."
        )
    check_whole(file, first, last)
    found = list(rows_from(file, first, last))
    if not found or found[0].position is None:
        raise InputError(f"{file.path} is not a recording of an arm with a tool.")
    part = _part(file, found, name)
    if bool(part.rests.all()):
        raise InputError(f"Nothing moves in this part of {file.path}.")
    return part


def _part(file: RecordingFile, found: list[StateRow], name: str) -> RecordedPart:
    count = len(found)
    t = np.array([row.t for row in found])
    shape = count, len(found[0].setpoint)
    setpoint = finite_array([row.setpoint for row in found], shape, f"setpoint of {file.path}")
    fingers = np.array([row.gripper_setpoint for row in found])
    waiting = np.array([row.status in WAITING for row in found])
    held, tools = tuple(_held(found)), tuple(row.tool for row in found)
    # The last of several states at nearly one time is kept, and always the first one.
    kept = np.append(np.diff(t) >= MIN_STEP, True)
    kept[0] = True
    if count > 1 and t[np.flatnonzero(kept)[1]] - t[0] < MIN_STEP:
        kept[np.flatnonzero(kept)[1]] = False
    t, numbers = _with_rests(t[kept], np.flatnonzero(kept))
    return RecordedPart(
        t - file.start,
        setpoint[numbers],
        fingers[numbers],
        waiting[numbers],
        tuple(held[number] for number in numbers.tolist()),
        tuple(tools[number] for number in numbers.tolist()),
        name,
    )


def _with_rests(t: FloatArray, numbers: IntArray) -> tuple[FloatArray, IntArray]:
    """Return ``t`` and ``numbers`` (N,) with the end of each rest added.

    An arm at rest writes no states, so the state before a gap lasts until one tick before its end.
    """
    before = np.flatnonzero(np.diff(t) > MIN_GAP)
    return (
        np.insert(t, before + 1, t[before + 1] - TICK),
        np.insert(numbers, before + 1, numbers[before]),
    )


def _held(found: list[StateRow]) -> Iterator[str]:
    """Yield the name of the object that the fingers hold in each state; "" for none."""
    held = ""
    for row in found:
        for pose in row.objects:
            if pose.held:
                held = pose.name
            elif pose.name == held:
                held = ""
        if held in row.removed:
            held = ""
        yield held
