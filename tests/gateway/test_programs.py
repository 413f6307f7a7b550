"""Test programs that the Python client requests, and the command on a real server."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.gateway.virtual import VirtualServer

ROOT = Path(__file__).resolve().parents[2]
READY = np.deg2rad((0.0, -68.0, 85.0, 8.0, 0.0))

THERE_AND_BACK = """\
name: There and back
steps:
  - joints: [20, -64, 85, 8, 0]
  - line: {by: {z: 20}}
  - home
"""


@pytest.fixture
def arm(local: VirtualServer) -> Iterator[Client]:
    with local.connect("Test") as arm:
        yield arm


def planned(arm: Client, text: str) -> answers.Progress:
    """Send a script and wait until it is planned or refused."""
    for at in range(0, len(text), 100):
        more = at + 100 < len(text)
        arm.ask(Program(text=text[at : at + 100], more=more))
    return wait(arm, lambda program: program.status != "planning")


def wait(
    arm: Client, until: Callable[[answers.Progress], bool], seconds: float = 20.0
) -> answers.Progress:
    due, program = time.monotonic() + seconds, None
    while time.monotonic() < due:
        program = arm.query(answers.State).program
        if program is not None and until(program):
            return program
        time.sleep(0.02)
    raise AssertionError(f"still {program}")


def run(arm: Client, order: ProgramOrder = ProgramOrder.RUN) -> None:
    assert planned(arm, THERE_AND_BACK).status == "ready"
    arm.ask(Steer(order=order))


def test_program_runs_to_its_end_under_its_own_name(arm: Client) -> None:
    run(arm)
    during = arm.query(answers.State)
    assert during.holder is not None
    assert during.holder.startswith("There and back")
    lines = set()
    while (program := arm.query(answers.State).program) is not None and program.status == "running":
        lines.add(program.line)
        time.sleep(0.02)
    assert program is not None
    assert (program.status, program.why) == ("done", "")
    assert {3, 4, 5} <= lines
    after = arm.query(answers.State)
    assert after.holder is None
    assert np.abs(np.array(after.q) - READY).max() < 1e-9


def test_program_is_paused_stepped_and_ended(arm: Client) -> None:
    run(arm, ProgramOrder.STEP)
    assert wait(arm, lambda program: program.status == "paused").line == 4
    arm.ask(Steer(order=ProgramOrder.RESUME))
    wait(arm, lambda program: program.line == 5 and program.fraction > 0.1)
    arm.ask(Steer(order=ProgramOrder.PAUSE))
    assert wait(arm, lambda program: program.status == "paused").line == 5
    arm.ask(Steer(order=ProgramOrder.END))
    state = arm.query(answers.State)
    assert state.program is not None
    assert state.program.status == "stopped"
    assert state.holder is None


def test_lease_can_be_taken_from_a_program(local: VirtualServer, arm: Client) -> None:
    run(arm)
    with local.connect("Boss") as boss:
        boss.ask(requests.Take())
        program = wait(boss, lambda program: program.status != "running", 1.0)
        assert program.status == "stopped"
        assert "taken" in program.why


def test_errors_are_reported_with_their_lines(arm: Client) -> None:
    program = planned(arm, "steps:\n  - hme\n  - wait: x\n")
    assert program.status == "refused"
    assert "line 2, column 5" in program.why
    assert "line 3, column 11" in program.why
    program = planned(arm, "steps:\n  - home\n  - line: {by: {z: -285}}\n")
    assert "line 3" in program.why
    assert "table" in program.why
    program = planned(arm, "gripper: none\nsteps: [home]\n")
    assert "without its gripper" in program.why
    with pytest.raises(RefusedError, match="without its gripper"):
        arm.ask(Steer(order=ProgramOrder.RUN))


def test_script_that_is_too_long_is_refused(arm: Client) -> None:
    part = "#" * 900 + "\n"
    for _ in range(72):
        arm.ask(Program(text=part, more=True))
    with pytest.raises(RefusedError, match="at most 64 KB"):
        arm.ask(Program(text=part, more=True))
