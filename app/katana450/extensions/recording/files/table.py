"""Recordings as tables: columns in memory, and CSV files of the motion."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from msgspec import structs

from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.progress import report
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import content_of
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    STATE,
    ObjectPose,
    StateRow,
    nanoseconds,
)
from katana450.maths.geometry.arrays import FloatArray, finite_array

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
