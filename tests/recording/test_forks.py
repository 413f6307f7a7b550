"""A run continues from any moment of a recording, to the bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.arm.runtime.tick import Submission
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.errors import InputError
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import MOMENT, recorded_input, state_after
from katana450.extensions.recording.messages import COMMANDS
from katana450.extensions.recording.ticks import Digester, TickInput, after
from katana450.settings import Settings
from tests.conftest import LONG
from tests.general_arms.links_of_arms import ur5e
from tests.recording.recorded import (
    Commands,
    described,
    dragging,
    fresh,
    random_commands,
    record,
)
from tests.recording.sessions import Commands as SessionCommands
from tests.recording.sessions import drag, program, record_session

FORKS = 20 if LONG else 5
SECONDS = 5.0 if LONG else 0.5
"""[s] Time for which a continuation is compared with the recording."""

GRASP = """frame: base
steps:
  - grasp: cup
  - line: {by: {z: 60}}
  - nudge: {axis: 1, by: 10}
  - line: {by: {z: -52}}
  - gripper: open
"""
"""Script that carries the cup, and lets it fall by 8 mm."""


Make = Callable[[Path], DescribedRobot]
"""Function that writes a recording, and returns a new session of its robot."""


def random_session(seed: int, commands: Commands = random_commands) -> Make:
    def make(path: Path) -> DescribedRobot:
        record(path, 3000 if LONG else 400, seed, commands)
        return fresh()

    return make


def session(ticks: int, commands: Callable[[], SessionCommands]) -> Make:
    def make(path: Path) -> DescribedRobot:
        record_session(path, ticks, commands())
        return fresh()

    return make


def other_arm(seed: int) -> Make:
    """Return what records random joints of a UR5e."""

    def make(path: Path) -> DescribedRobot:
        urdf, rng = path.with_name("ur5e.urdf"), np.random.default_rng(seed)
        urdf.write_text(ur5e(), encoding="utf-8")
        robot = find_robot(Settings(), urdf, None)

        def commands(tick: int, _state: State) -> Iterator[cmd.Command]:
            if tick % 50 == 5:
                yield cmd.Joints(robot.session.ready + rng.uniform(-0.3, 0.3, 6))

        record_session(path, 800, commands, robot=robot, urdf=urdf)
        return find_robot(Settings(), urdf, None)

    return make


POUR = script_text(library_file("pour"))
MAKES = [
    *(random_session(seed) for seed in range(24)),
    *(random_session(seed, dragging) for seed in range(10)),
    *(session(700, partial(drag, 600, circles=1.0 + turns)) for turns in range(6)),
    *(other_arm(seed) for seed in range(6)),
    *[session(1500, partial(program, GRASP)), session(3500, partial(program, POUR))] * 2,
]


@pytest.mark.cases(1)
@pytest.mark.parametrize("make", MAKES)
def test_forks_continue_as_the_recording(make: Make, tmp_path: Path) -> None:
    """Fork 50 recordings at 20 random moments each, and compare every state of 5 s."""
    rng, digester = np.random.default_rng(5), Digester()
    session = make(tmp_path / "run.mcap").session
    rest = session.begin(session.ready, 0.0, 0.0)
    with RecordingFile.open(tmp_path / "run.mcap") as file:
        times = [message.t for message in file.messages(COMMANDS)]
        for moment in rng.choice(times[1:-60], FORKS, replace=False).tolist():
            state = state_after(session, list(recorded_input(file, moment, moment)))
            ticks = [
                tick
                for tick in recorded_input(file, moment, moment + SECONDS)
                if isinstance(tick, TickInput) and tick.t > moment + MOMENT
            ]
            if ticks[0].failed:
                continue
            restore = Submission(cmd.RestoreState(state), None)
            ticks[0] = replace(ticks[0], submissions=(restore, *ticks[0].submissions))
            fork: State = replace(rest, t=state.t)
            for number, tick in enumerate(ticks):
                fork = after(session, fork, tick)
                if number == 0:
                    fork = replace(fork, outcomes=fork.outcomes[1:])
                assert digester.digest(fork) == tick.digest


def test_moment_that_another_version_recorded_is_refused(run: Path) -> None:
    session = described().session
    with RecordingFile.open(run) as file:
        end = file.end
        moments = list(recorded_input(file, end, end))
    assert isinstance(moments[-1], TickInput)
    with pytest.raises(InputError, match="another version"):
        state_after(session, [*moments[:-1], replace(moments[-1], digest="0" * 10)])
    with pytest.raises(InputError, match="not recorded completely"):
        state_after(session, moments[-1:])
