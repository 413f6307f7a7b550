"""States of an arm over time, for display: of a script, a table of joint values, or a pose."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.errors import InputError
from katana450.extensions.export.trajectory_file import load_motion
from katana450.settings import Settings


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
    from katana450.extensions.programs.run.clocked_run import plan_script, run_by_clock
    from katana450.extensions.programs.script.circle import CircleDemo
    from katana450.extensions.programs.script.pour import PourDemo
    from katana450.extensions.programs.script.script import parse
    from katana450.extensions.programs.script.script_files import script_text

    demos = {"circle": CircleDemo, "pour": PourDemo}
    try:
        text = demos[name]().text if name in demos else script_text(Path(name))
        plan = plan_script(parse(text), urdf)
    except ScriptError as error:
        found = error.problems[0]
        file = str(Path(name).parent / found.file) if found.file else name
        raise InputError(f"{file}:{found.line}:{found.column}: {found.text}") from error
    states = run_by_clock(plan).states
    return Playback(plan.robot, plan.session, states, Settings().rate, plan.script.bare)


def of_pose(pose: Sequence[float], urdf: Path) -> Playback:
    """Return the robot at rest with its driven joints at ``pose`` [rad, m]; ready if empty."""
    robot, session = _described(urdf)
    if not pose:
        return Playback(robot, session, [_at_rest(session)], 1.0)
    return Playback(robot, session, [_standing(robot, session, robot.values(pose))], 1.0)


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


def _at_rest(session: Session) -> State:
    """Return the state of an arm at rest in its ready posture."""
    gripper = 0.0 if session.arm is None else session.arm.gripper.clamp(0.0)
    return session.begin(session.ready, gripper, 0.0)


def _standing(robot: Robot, session: Session, values: dict[str, float], t: float = 0.0) -> State:
    names = robot.driven if robot.arm is None else robot.arm.chain.names
    q = np.array([values[name] for name in names])
    fingers = {} if robot.arm is None else robot.arm.fingers
    driven = [name for name, follows in fingers.items() if follows == (1.0, 0.0)]
    return session.begin(q, values[driven[0]] if driven else 0.0, t)
