"""Recordings as tables: columns in memory, and CSV files of the motion."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.progress import report
from katana450.extensions.recording.files.checking import state_numbers
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.topics import CHECKPOINTS, STATE
from katana450.maths.geometry.arrays import FloatArray, finite_array

NUMBERS = ("t", "gripper", "gripper_setpoint", "speed", "q", "qd", "setpoint")
LEAST = 1e-3
"""[s] Least length of a part of which progress is reported."""

POSITION = "position"
"""Names of the columns of every robot, and of that of a robot with a tool only."""


def rows(
    file: RecordingFile,
    start: float = -math.inf,
    end: float = math.inf,
    done: Callable[[float], None] | None = None,
) -> Iterator[dict[str, Any]]:
    """Yield the states that were written from ``start`` to ``end`` [s].

    ``done`` is called with the fraction that was read. Raises InputError.
    """
    first, last = max(start, file.start), min(end, file.end)
    for message in file.messages(STATE, start=start, end=end):
        row = state_numbers(message)
        if done is not None:
            done((message.t - first) / max(last - first, LEAST))
        if not isinstance(row.get("t"), int | float):
            raise InputError(
                f"{file.path} is damaged: the state at t = {message.t:.3f} s has no time."
            )
        yield row


def state_at(file: RecordingFile, t: float) -> dict[str, Any] | None:
    """Return the last state at or before ``t`` [s], with all its objects; None if there is none.

    Only objects that changed are in the message of a state; the others are those since the last
    complete state. Raises InputError for a damaged recording.
    """
    checkpoint = file.last_before(CHECKPOINTS, t)
    found: dict[str, Any] | None = None
    objects: dict[str, Any] = {}
    try:
        for found in rows(file, -math.inf if checkpoint is None else checkpoint.t, t):
            objects.update({each["name"]: each for each in found.pop("objects", ())})
            for name in found.pop("removed", ()):
                objects.pop(name, None)
    except (TypeError, KeyError) as error:
        raise InputError(f"{file.path} is damaged: the objects of a state are wrong.") from error
    return None if found is None else {**found, "objects": list(objects.values())}


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
    found = list(rows(file, start, end, done))
    if not found:
        raise InputError(f"{file.path} has no states in that time.")
    names = [*NUMBERS, *([POSITION] if POSITION in found[0] else [])]
    table = {}
    for name in names:
        first = found[0].get(name)
        width = len(first) if isinstance(first, list) else None
        shape = (len(found),) if width is None else (len(found), width)
        values = [row.get(name) for row in found]
        if any(value is None for value in values):
            raise InputError(f"{file.path} is damaged: it has a state without {name}.")
        table[name] = finite_array(values, shape, f"{name} of {file.path}")  # type: ignore[arg-type]
    return table


def setpoint_table(
    file: RecordingFile, start: float = -math.inf, end: float = math.inf
) -> dict[str, FloatArray]:
    """Return the setpoints as columns (N,) by their names.

    These are ``t`` [s] from 0, which increases, ``theta1`` and so on [rad or m], and for an arm
    ``gripper`` [rad or m]. Raises InputError.
    """
    table = columns(file, start, end, report)
    t, q = table["t"], table["setpoint"]
    # An extra tick for a STOP can have the time of the tick before.
    later = np.concatenate(([True], np.diff(t) > 0.0))
    found = {"t": t[later] - t[0]}
    found.update({f"theta{axis}": row for axis, row in enumerate(q[later].T, start=1)})
    if "position" in table:
        found["gripper"] = table["gripper_setpoint"][later]
    return found


def write_csv(
    file: RecordingFile, out: Path, start: float = -math.inf, end: float = math.inf
) -> int:
    """Write ``setpoint_table`` as a CSV file and return the number of its rows.

    Its 17 digits are exact. Raises InputError.
    """
    table = setpoint_table(file, start, end)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    lines = np.stack(list(table.values()), axis=1)
    writer.writerows([f"{value:.17g}" for value in line] for line in lines.tolist())
    write_files({out: writer_of(text.getvalue().encode())})
    return len(lines)
