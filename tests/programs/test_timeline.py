"""Tests of the objects and the water at the times of a program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.state.state import ActiveStop
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.simulation import Moment, moments
from tests.programs.conftest import Stage

CARRY = """\
frame: base
steps:
- fill: 100
- grasp: {object: cup, pitch: 30}
- line: {by: {z: 60}}
- wait: 0.3
- set_down
"""


@pytest.fixture(scope="module")
def carried(stage: Stage) -> tuple[Program, list[Moment]]:
    program = stage.planned(CARRY)
    return program, list(moments(program, stage.session, stage.begin()))


def test_moments_are_on_the_clock_of_the_program(carried: tuple[Program, list[Moment]]) -> None:
    program, moments = carried
    times = [moment.t for moment in moments]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(program.duration)
    # A motion is at its end when the schedule says so.
    for task in program.schedule:
        action = program.tasks[task.number].action
        if isinstance(action, FollowPlan):
            near = min(moments, key=lambda moment: abs(moment.t - task.end))
            assert near.t == pytest.approx(task.end, abs=0.05)
            np.testing.assert_allclose(near.state.q, action.plan.end, rtol=0, atol=0.03)


def test_stop_and_pause_of_the_arm_do_not_hinder_the_preview(stage: Stage) -> None:
    text = "steps:\n  - joints: [20, -68, 85, 8, 0]\n  - wait: 1\n  - joints: [0, -68, 85, 8, 0]"
    program = stage.planned(text)
    state = replace(stage.begin(), stopped=ActiveStop(0.0, 0.0), paused=True, speed=0.1)
    *_, last = moments(program, stage.session, state)
    assert last.t == pytest.approx(program.duration)
    assert last.state.stopped is None


def test_preview_of_a_failing_program_ends_there(stage: Stage) -> None:
    program = stage.planned("steps: [home]")
    assert [moment.t for moment in moments(program, stage.session, stage.begin())] == [0.0]
    text = "steps:\n  - joints: [20, -68, 85, 8, 0]\n  - joints: [0, -68, 85, 8, 0]"
    program = stage.planned(text)
    # The arm stands elsewhere by now.
    q = stage.begin().setpoint + 0.3
    moved = stage.session.begin(q, 0.0, 0.0)
    *_, last = moments(program, stage.session, moved)
    assert last.t == 0.0
    np.testing.assert_allclose(last.state.q, q)
