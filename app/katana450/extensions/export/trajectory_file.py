"""A motion as a table of times and joint values, in CSV.

The first line of a CSV file has the names of the columns, `t` first. Every line after it has a time
[s] and the value of each named joint [rad, m]:

    t,theta1,theta2,theta3,theta4,theta5,gripper

`theta1` is the first driven joint and so on; `gripper` is the driven joint after the fifth. Joints
can also have their own names. The table of a report, `trace.csv`, is such a file too: its columns
of times and joints are taken, in its units, and the others left out. Joints that are not named stay
at zero.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

THETA = re.compile(r"theta([1-9][0-9]?)")
"""Pattern of the numbered names of joints."""

GRIPPER = 6
"""Number of the driven joint that `gripper` names."""

REPORT_COLUMN = re.compile(r"(t|theta[1-9][0-9]?|fingers)_(s|deg|mm)")
"""Pattern of the columns that are taken from the table of a report, with their units."""

REPORT_UNITS = {"s": 1.0, "deg": math.radians(1.0), "mm": 1e-3}
"""[s, rad, m] Units of these columns."""

MAX_ROWS = 100_000
"""Maximum number of rows of a file."""


WIDEST_TURN = 1.0
"""[rad] Maximum rotation between two keys. Programs interpolate on the shorter arc, so it must be
unambiguous.
"""


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """The motion of all joints of a robot.

    Attributes:
        t: (n,) [s], from 0, increasing.
        values: (n,) [rad, m] of every joint.
    """

    t: FloatArray
    values: Mapping[str, FloatArray]

    @property
    def start(self) -> dict[str, float]:
        """The value [rad, m] of every joint at the first sample."""
        return {name: float(values[0]) for name, values in self.values.items()}

    def keys(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return times (k,) [s] and values (k,) of one joint, with more keys in large rotations."""
        values = self.values[name]
        counts = np.maximum(np.ceil(np.abs(np.diff(values)) / WIDEST_TURN), 1.0).astype(int)
        places = [row + np.arange(count) / count for row, count in enumerate(counts.tolist())]
        place = np.concatenate((*places, [len(counts)]))
        rows = np.arange(len(values))
        return np.interp(place, rows, self.t), np.interp(place, rows, values)


def load_motion(path: Path, robot: Robot) -> RecordedMotion:
    """Return the motion of ``robot`` in a .csv file.

    Raises InputError for a file that cannot be read or is not such a table, for unknown joints, and
    for values outside the limits of a joint.
    """
    if path.suffix.lower() != ".csv":
        raise InputError(f"{path} must end in .csv.")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read: {error}.") from error
    return _motion(path, _csv_columns(path, text), robot)


def _csv_columns(path: Path, text: str) -> dict[str, list[float]]:
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines()) if row]
    if not rows:
        raise InputError(f"{path} is empty. Its first line must name the columns, t first.")
    names = rows[0]
    if len(set(names)) != len(names):
        raise InputError(f"{path} names a column twice: {', '.join(names)}.")
    # Place and unit of each column; a report has more columns than a motion.
    columns = {name: (place, 1.0) for place, name in enumerate(names)}
    if names[0] == "t_s":
        columns = {
            "gripper" if match[1] == "fingers" else match[1]: (place, REPORT_UNITS[match[2]])
            for place, name in enumerate(names)
            if (match := REPORT_COLUMN.fullmatch(name))
        }
    numbers: list[list[float]] = []
    for count, row in enumerate(rows[1:], start=1):
        try:
            if len(row) != len(names):
                raise ValueError(f"it has {len(row)} values, not {len(names)}")
            numbers.append([unit * float(row[place]) for place, unit in columns.values()])
        except ValueError as error:
            raise InputError(f"Row {count} of {path}: {error}.") from error
    return {name: [row[number] for row in numbers] for number, name in enumerate(columns)}


def _motion(path: Path, columns: Mapping[str, list[float]], robot: Robot) -> RecordedMotion:
    if "t" not in columns:
        raise InputError(f"{path} has no column t; it has {', '.join(columns)}.")
    count = len(columns["t"])
    if not 2 <= count <= MAX_ROWS:
        raise InputError(f"{path} has {count} rows; a motion has from 2 to {MAX_ROWS}.")
    table = {
        name: finite_array(column, (count,), f"The column {name} of {path}")
        for name, column in columns.items()
    }
    t = table.pop("t")
    if not (np.diff(t) > 0.0).all():
        row = int(np.argmin(np.diff(t) > 0.0)) + 2
        raise InputError(f"t of {path} must increase from row to row; in row {row} it does not.")
    given: dict[str, FloatArray] = {}
    for column, values in table.items():
        name = _joint(path, column, robot)
        if name in given:
            raise InputError(f"{path} names the joint {name} twice.")
        for value in (values.min(), values.max()):
            robot.check(name, float(value))
        given[name] = values
    rows = [
        robot.every({name: float(values[row]) for name, values in given.items()})
        for row in range(count)
    ]
    every = {name: frozen([row[name] for row in rows]) for name in robot.joints}
    return RecordedMotion(frozen(t - t[0]), every)


def _joint(path: Path, column: str, robot: Robot) -> str:
    driven = robot.driven
    if column in driven:
        return column
    theta = THETA.fullmatch(column)
    number = int(theta[1]) if theta else GRIPPER if column == "gripper" else 0
    if not 1 <= number <= len(driven):
        raise InputError(
            f"{path} names {column!r}, which is not a driven joint of {robot.name}. "
            f"These are {', '.join(driven)}."
        )
    return driven[number - 1]
