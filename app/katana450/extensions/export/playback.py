"""States of an arm over time, for display."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.errors import InputError
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
    """Return the playback of ``options.run``, else of a pose."""
    if options.run is not None:
        return of_script(options.run, options.urdf)
    return of_pose(options.pose, options.urdf)


def of_script(name: str, urdf: Path) -> Playback:
    """Return the run of a demo or of a script file, simulated with a progress bar.

    Raises InputError with the line of an error in the script.
    """
    # Imported here, because poses do not need the extension ``programs``.
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
    robot, session, notes = find_robot(Settings(), urdf, None)
    for note in notes:
        print(f"katana450: {note}", file=sys.stderr)
    if pose:
        return Playback(robot, session, [_standing(robot, session, robot.values(pose))], 1.0)
    gripper = 0.0 if session.arm is None else session.arm.gripper.clamp(0.0)
    return Playback(robot, session, [session.begin(session.ready, gripper, 0.0)], 1.0)


def _standing(robot: Robot, session: Session, values: dict[str, float]) -> State:
    names = robot.driven if robot.arm is None else robot.arm.chain.names
    q = np.array([values[name] for name in names])
    fingers = {} if robot.arm is None else robot.arm.fingers
    driven = [name for name, follows in fingers.items() if follows == (1.0, 0.0)]
    return session.begin(q, values[driven[0]] if driven else 0.0, 0.0)
