"""States of an arm over time, for display; and a motion as a table of times and joint values.

Such a table is a CSV file. Its first line has the names of the columns, `t` first. Every line after
it has a time [s] and the value of each named joint [rad, m]:

    t,theta1,theta2,theta3,theta4,theta5,gripper

`theta1` is the first driven joint and so on; `gripper` is the driven joint after the fifth. Joints
can also have their own names. Joints that are not named stay at zero.
"""

from __future__ import annotations

import csv
import re
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.settings import Settings

THETA = re.compile(r"theta([1-9][0-9]?)")
"""Pattern of the numbered names of joints."""

GRIPPER = 6
"""Number of the driven joint that `gripper` names."""

MAX_ROWS = 100_000
"""Maximum number of rows of a file."""


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """The motion of all joints of a robot.

    Attributes:
        t: (n,) [s], from 0, increasing.
        values: (n,) [rad, m] of every joint.
    """

    t: FloatArray
    values: Mapping[str, FloatArray]


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
    numbers: list[list[float]] = []
    for count, row in enumerate(rows[1:], start=1):
        try:
            if len(row) != len(names):
                raise ValueError(f"it has {len(row)} values, not {len(names)}")
            numbers.append([float(cell) for cell in row])
        except ValueError as error:
            raise InputError(f"Row {count} of {path}: {error}.") from error
    return {name: [row[number] for row in numbers] for number, name in enumerate(names)}


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
    columns_by_joint: dict[str, FloatArray] = {}
    for column, values in table.items():
        name = _joint(path, column, robot)
        if name in columns_by_joint:
            raise InputError(f"{path} names the joint {name} twice.")
        for value in (values.min(), values.max()):
            robot.check(name, float(value))
        columns_by_joint[name] = values
    rows = [
        robot.every({name: float(values[row]) for name, values in columns_by_joint.items()})
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


class Playback(NamedTuple):
    """An arm, and its states at a fixed rate; one state if the arm does not move.

    Attributes:
        robot: the robot.
        session: the rules of the arm.
        states: the states, the first at time 0.
        rate: states per second [Hz].
        bare: whether the arm has no gripper.
    """

    robot: Robot
    session: Session
    states: Sequence[State]
    rate: float
    bare: bool = False

    def at(self, t: float) -> State:
        """Return the state nearest to ``t`` [s]; the last state after the end."""
        return self.states[min(round(t * self.rate), len(self.states) - 1)]

    @property
    def duration(self) -> float:
        """The duration [s]."""
        return (len(self.states) - 1) / self.rate


def chosen(options: Namespace) -> Playback:
    """Return the playback of ``options.run``, else of ``options.trajectory``, else of a pose."""
    if options.run is not None:
        return of_script(options.run, options.urdf)
    if options.trajectory is not None:
        return of_trajectory(options.trajectory, options.urdf)
    return of_pose(options.pose, options.urdf)


def of_script(name: str, urdf: Path) -> Playback:
    """Return the run of a demo or of a script file, simulated with a progress bar.

    Raises InputError with the line of an error in the script.
    """
    # Imported here, because poses and tables do not need the extension ``programs``.
    from katana450.extensions.programs.language.source import ScriptError
    from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
    from katana450.extensions.programs.script.script import parse
    from katana450.extensions.programs.script.script_files import library_file, script_text

    try:
        own = library_file(name)
        plan = plan_script(parse(script_text(own if own.exists() else Path(name))), urdf)
    except ScriptError as error:
        problem = error.problems[0]
        raise InputError(f"{name}:{problem.line}:{problem.column}: {problem.text}") from error
    states = run_by_clock(plan).states
    return Playback(plan.robot, plan.session, states, Settings().rate, plan.script.bare)


def of_pose(pose: Sequence[float], urdf: Path) -> Playback:
    """Return the robot at rest with its driven joints at ``pose`` [rad, m]; ready if empty."""
    robot, session = _described(urdf)
    if pose:
        return Playback(robot, session, [_standing(robot, session, robot.values(pose))], 1.0)
    gripper = 0.0 if session.arm is None else session.arm.gripper.clamp(0.0)
    return Playback(robot, session, [session.begin(session.ready, gripper, 0.0)], 1.0)


def of_trajectory(path: Path, urdf: Path) -> Playback:
    """Return the motion of a table of joint values. Raises InputError for an invalid file."""
    robot, session = _described(urdf)
    motion, rate = load_motion(path, robot), Settings().rate
    t = np.arange(int(motion.t[-1] * rate) + 1) / rate
    rows = {name: np.interp(t, motion.t, values) for name, values in motion.values.items()}
    states = [
        _standing(robot, session, {name: float(row[k]) for name, row in rows.items()}, time)
        for k, time in enumerate(t.tolist())
    ]
    return Playback(robot, session, states, rate)


def _described(urdf: Path) -> tuple[Robot, Session]:
    robot, session, notes = find_robot(Settings(), urdf, None)
    for note in notes:
        print(f"katana450: {note}", file=sys.stderr)
    return robot, session


def _standing(robot: Robot, session: Session, values: dict[str, float], t: float = 0.0) -> State:
    names = robot.driven if robot.arm is None else robot.arm.chain.names
    q = np.array([values[name] for name in names])
    fingers = {} if robot.arm is None else robot.arm.fingers
    driven = [name for name, follows in fingers.items() if follows == (1.0, 0.0)]
    return session.begin(q, values[driven[0]] if driven else 0.0, t)
