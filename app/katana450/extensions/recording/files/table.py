"""Recordings as tables: columns in memory, CSV files of the motion, and states at given times.

Joints are those that were recorded. The messages of states have only these and poses; for pictures,
the recorded commands are simulated, which gives all objects and water.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from msgspec import structs

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.progress import report
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import (
    MOMENT,
    content_of,
    recorded_input,
    simulated_states,
)
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    STATE,
    ObjectPose,
    StateRow,
    nanoseconds,
)
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

SINGLE, ROWS = ("t", "gripper", "gripper_setpoint", "speed"), ("qd", "setpoint")
"""Names of the columns with one number for a state, and with one for each joint."""

LEAST = 1e-3
"""[s] Least length of a part of which progress is reported."""

POSITION = "position"
"""Name of the column of a robot with a tool only."""


def rows(
    file: RecordingFile,
    start: float = -math.inf,
    end: float = math.inf,
    done: Callable[[float], None] | None = None,
) -> Iterator[StateRow]:
    """Yield the states that were written from ``start`` to ``end`` [s].

    ``done`` is called with the fraction that was read. Raises InputError.
    """
    first, last = max(start, file.start), min(end, file.end)
    for message in file.messages(STATE, start=start, end=end):
        if done is not None:
            done((message.t - first) / max(last - first, LEAST))
        yield content_of(message, StateRow)


def state_at(file: RecordingFile, t: float) -> StateRow | None:
    """Return the last state at or before ``t`` [s], with all its objects; None if there is none.

    Only objects that changed are in the message of a state; the others are those since the last
    complete state. Raises InputError for a damaged recording.
    """
    checkpoint = file.last_before(CHECKPOINTS, t)
    state: StateRow | None = None
    objects: dict[str, ObjectPose] = {}
    for state in rows(file, -math.inf if checkpoint is None else checkpoint.t, t):
        state.move_objects(objects)
    if state is not None:
        state.objects, state.removed = list(objects.values()), []
    return state


def rows_from(file: RecordingFile, start: float, end: float) -> Iterator[StateRow]:
    """Yield the states from ``start`` to ``end`` [s]; the first has all objects and that time.

    Raises InputError.
    """
    before = state_at(file, start)
    if before is not None:
        yield structs.replace(before, t=start)
    for row in rows(file, start, end):
        # The times of messages are whole nanoseconds, those of states are not.
        if before is None or nanoseconds(row.t) > nanoseconds(start):
            yield row


def columns(
    file: RecordingFile,
    start: float = -math.inf,
    end: float = math.inf,
    done: Callable[[float], None] | None = None,
) -> dict[str, FloatArray]:
    """Return the numbers of all states as arrays with one row for each, by their names.

    Names: ``t``, ``q``, ``qd``, ``setpoint``, ``gripper``, ``gripper_setpoint``, ``speed``, and
    ``position`` of an arm. ``done`` is called with the fraction that was read. Raises InputError
    for a damaged recording.
    """
    states = list(rows(file, start, end, done))
    if not states:
        raise InputError(f"{file.path} has no states in that time.")
    columns = {name: [getattr(row, name) for row in states] for name in SINGLE}
    columns |= {name: [getattr(row, name) for row in states] for name in ROWS}
    columns["q"] = [row.joints for row in states]
    if states[0].position is not None:
        columns[POSITION] = [row.position for row in states]
    return {
        name: finite_array(
            values,
            (len(states),) if name in SINGLE else (len(states), len(values[0])),
            f"{name} of {file.path}",
        )
        for name, values in columns.items()
    }


def write_csv(
    file: RecordingFile, out: Path, start: float = -math.inf, end: float = math.inf
) -> int:
    """Write the setpoints as a CSV file and return the number of its rows.

    Its columns are ``t`` [s] from 0, which increases, ``theta1`` and so on [rad or m], and for an
    arm ``gripper`` [rad or m]. Its 17 digits are exact. Raises InputError.
    """
    table = columns(file, start, end, report)
    # An extra tick for a STOP can have the time of the tick before.
    later = np.concatenate(([True], np.diff(table["t"]) > 0.0))
    names = ["t", *(f"theta{axis}" for axis in range(1, table["setpoint"].shape[1] + 1))]
    numbers = [table["t"] - table["t"][0], table["setpoint"]]
    if POSITION in table:
        names.append("gripper")
        numbers.append(table["gripper_setpoint"])
    lines = np.column_stack(numbers)[later]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([f"{number:.17g}" for number in line] for line in lines.tolist())
    write_files({out: writer_of(text.getvalue().encode())})
    return len(lines)


MIN_FPS, MAX_FPS = 1, 100
"""[Hz] Range of frames per second: more than the recorded ticks would only repeat them."""

MAX_FRAMES = 10_000_000
"""Maximum number of frames of an episode, more than a day."""

TICK = 0.01
"""[s] Time between two ticks of the control loop."""

MAX_STEP = 2.5 * TICK
"""[s] Maximum time between two states of a motion; within more the arm rests."""

ROUNDING = 1e-6
"""[1] Fraction of a frame by which an episode may be too short for its last frame."""


def check_fps(fps: int) -> None:
    """Raise InputError unless a dataset can have ``fps`` frames per second."""
    if not MIN_FPS <= fps <= MAX_FPS:
        raise InputError(
            f"A dataset must have {MIN_FPS} to {MAX_FPS} frames per second, not {fps}; the arm is "
            f"recorded {MAX_FPS} times a second."
        )


def frame_times(start: float, end: float, fps: int) -> FloatArray:
    """Return the times (N,) [s] of the frames from ``start`` to ``end``, 1 / ``fps`` apart.

    Raises InputError for too many.
    """
    if (end - start) * fps > MAX_FRAMES:
        raise InputError(
            f"{end - start:.0f} s at {fps} frames per second are more than {MAX_FRAMES} frames. "
            "Choose a part, or fewer frames per second."
        )
    count = max(math.floor((end - start) * fps + ROUNDING) + 1, 0)
    return start + np.arange(count) / fps


def sampled(t: FloatArray, values: FloatArray, times: FloatArray) -> FloatArray:
    """Return the values at ``times`` (N,) [s] of states at ``t`` (M,), which do not decrease.

    Values between two ticks of a motion are interpolated. A state without a successor holds, as the
    arm rests then, until a tick before the next one. Before the first state, that one is returned.

    Args:
        t: times of the states [s].
        values: their values, (M,) or (M, n).
        times: times to sample at [s].
    """
    index = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 1)
    after = np.minimum(index + 1, len(t) - 1)
    begin, end = t[index], t[after]
    begin = np.where(end - begin > MAX_STEP, end - TICK, begin)
    length = end - begin
    fraction = np.divide(times - begin, length, out=np.zeros(len(times)), where=length > 0.0)
    fraction = np.clip(fraction, 0.0, 1.0).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[index] + fraction * (values[after] - values[index]))


def columns_from(file: RecordingFile, start: float, end: float) -> dict[str, FloatArray]:
    """Return ``columns`` of the states from ``start`` to ``end`` [s], and of the next outside.

    An arm at rest writes no states, so the state at ``start`` may be older. Raises InputError.
    """
    before = file.last_before(STATE, start)
    return columns(file, start if before is None else before.t - MOMENT, end + MAX_STEP)


class RecordedStates:
    """The states of one recording. For use in one thread."""

    def __init__(self, file: RecordingFile, session: Session) -> None:
        """Read ``file``; ``session`` has the rules of its robot."""
        self._file, self._session = file, session
        self.unknown = 0
        """Number of ticks that cannot be simulated, during which objects and water hold still."""

    def at(self, times: FloatArray) -> Iterator[State]:
        """Yield the state at each of ``times`` (N,) [s], which increase. Raises InputError."""
        if not len(times):
            return
        table = columns_from(self._file, float(times[0]), float(times[-1]))
        q = sampled(table["t"], table["q"], times)
        gripper = sampled(table["t"], table["gripper"], times)
        begin, end = float(times[0]), float(times[-1])
        tick_inputs = recorded_input(self._file, begin, end)
        states = filter(None, simulated_states(self._session, tick_inputs, self._lose))
        known, following = None, next(states, None)
        for number, t in enumerate(times.tolist()):
            while following is not None and (known is None or following.t <= t + MOMENT):
                known, following = following, next(states, None)
            if known is None:
                raise InputError(f"{self._file.path} has no complete state before {t:.3f} s.")
            yield replace(known, q=frozen(q[number]), gripper=float(gripper[number]))

    def _lose(self, ticks: int) -> None:
        self.unknown += ticks
