"""A run continues from any moment of a recording, to the bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.arm.runtime.tick import Submission
from katana450.errors import InputError
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import MOMENT, recorded_input, state_after
from katana450.extensions.recording.messages import COMMANDS
from katana450.extensions.recording.ticks import Digester, TickInput, after
from tests.conftest import LONG
from tests.recording.recorded import described, fresh, record
from tests.recording.sessions import drag, program, record_session

FORKS = 60 if LONG else 5
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


def random_session(path: Path) -> Path:
    record(path, 3000 if LONG else 400)
    return path


def dragged(path: Path) -> Path:
    return record_session(path, 400, drag(300))


def scripted(text: str, ticks: int) -> Callable[[Path], Path]:
    return lambda path: record_session(path, ticks, program(text))


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(random_session, id="random"),
        pytest.param(dragged, id="drag", marks=pytest.mark.long),
        pytest.param(scripted(GRASP, 1500), id="grasp", marks=pytest.mark.long),
        pytest.param(
            scripted(script_text(library_file("pour")), 3500), id="pour", marks=pytest.mark.long
        ),
    ],
)
def test_forks_continue_as_the_recording(make: Callable[[Path], Path], tmp_path: Path) -> None:
    session, rng, digester = fresh().session, np.random.default_rng(5), Digester()
    rest = described().session.begin(session.ready, 0.0, 0.0)
    with RecordingFile.open(make(tmp_path / "run.mcap")) as file:
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
