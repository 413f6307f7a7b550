"""Recordings of sessions with given commands: the real control loop on a test clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.arm.drivers.driver import Driver
from katana450.assembly.robot_session import DescribedRobot
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.script.script import parse
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.resources import URDF_PATH
from tests.recording.recorded import PERIOD, described, header, run

Commands = Callable[[int, State], Iterator[cmd.Command]]
"""Function from the number of a tick and the state before it to the commands of the tick."""


def record_session(
    path: Path,
    ticks: int,
    commands: Commands,
    driver: Driver | None = None,
    robot: DescribedRobot | None = None,
    urdf: Path = URDF_PATH,
) -> Path:
    """Write a session of ``ticks`` ticks with ``commands`` to ``path``, and return it.

    ``driver``: the arm, at the ready posture; None for one that follows exactly. ``robot``:
    another one than the shipped one, of the description ``urdf``.
    """
    count = iter(range(ticks))
    with path.open("wb") as file:
        writer = RecordingWriter(file, header(robot=robot, urdf=urdf))
        run(
            ticks,
            1,
            writer.put,
            lambda _rng, state, _found: commands(next(count), state),
            odd=False,
            driver=driver,
            robot=robot,
        )
        writer.close()
    return path


def drag(
    ticks: int, extra: Mapping[int, cmd.Command] | None = None, circles: float = 1.0
) -> Commands:
    """Return a drag of the tool on a flat spiral for ``ticks`` ticks; ``extra``: other commands."""
    others = dict(extra or {})

    def commands(tick: int, state: State) -> Iterator[cmd.Command]:
        if tick in others:
            yield others[tick]
        elif tick < ticks and state.stopped is None and not state.paused:
            angle = 2.0 * np.pi * circles * tick / ticks
            radius = 0.06 * tick / ticks
            yield cmd.Position(
                np.array((0.3 + radius * np.cos(angle), radius * np.sin(angle), 0.05))
            )
        elif tick == ticks:
            yield cmd.EndDrag()

    return commands


def program(text: str) -> Commands:
    """Return the commands of the script ``text``, planned for the first state."""
    katana = described()
    context = PlanContext(katana.session, katana.robot.require_arm().T_base_shoulder)
    progress: list[tuple[object, Run]] = []

    def commands(tick: int, state: State) -> Iterator[cmd.Command]:
        if not progress:
            progress.append((compiled(parse(text), context, state), Run(0.0)))
        plan, before = progress[-1]
        if before.phase is Phase.RUNNING:
            after, sent = runner.step(plan, before, state, PERIOD * tick)  # type: ignore[arg-type]
            progress[-1] = plan, after
            assert after.phase in (Phase.RUNNING, Phase.DONE), after.why
            yield from sent

    return commands
