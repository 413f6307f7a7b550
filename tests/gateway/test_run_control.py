"""Test to continue a program, begin it at a step, and pause before a step."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest

from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Breakpoints, ProgramOrder, Steer
from tests.gateway.test_programs import planned, wait
from tests.gateway.virtual import VirtualServer

SCRIPT = """\
name: Three steps
steps:
  - joints: [12, -64, 85, 8, 0]
  - joints: [24, -64, 85, 8, 0]
  - joints: [12, -68, 85, 8, 0]
"""

END = np.deg2rad((12.0, -68.0, 85.0, 8.0, 0.0))


@pytest.fixture
def arm(local: VirtualServer) -> Iterator[Client]:
    with local.connect("Test") as arm:
        assert planned(arm, SCRIPT).status == "ready"
        yield arm


def posture(arm: Client) -> np.ndarray:
    return np.array(arm.query(answers.State).q)


def ended(arm: Client) -> answers.Progress:
    """Return the progress at the end of the run, which comes after its planning."""
    return wait(arm, lambda each: each.status in ("done", "failed", "refused", "stopped"))


def test_stopped_program_is_continued_after_the_stop_is_cleared(arm: Client) -> None:
    arm.ask(Steer(order=ProgramOrder.RUN))
    with pytest.raises(RefusedError, match="`resume` ends a pause"):
        arm.ask(Steer(order=ProgramOrder.CONTINUE))
    wait(arm, lambda each: each.step == 2 and each.fraction > 0.3)
    arm.stop()
    assert wait(arm, lambda each: each.status == "stopped").can_continue
    with pytest.raises(RefusedError, match="clear the stop"):
        arm.ask(Steer(order=ProgramOrder.CONTINUE))
    arm.clear_stop()
    stood = posture(arm)
    time.sleep(0.3)
    # Only the order moves it.
    assert np.array_equal(posture(arm), stood)
    arm.ask(Steer(order=ProgramOrder.CONTINUE))
    steps = set()
    while (now := arm.query(answers.State).program) is not None and now.status != "done":
        assert now.status in ("planning", "ready", "running"), now
        if now.status == "running":
            steps.add(now.step)
        time.sleep(0.02)
    assert steps == {2, 3}
    assert posture(arm) == pytest.approx(END, abs=1e-9)
    with pytest.raises(RefusedError, match="No program was interrupted"):
        arm.ask(Steer(order=ProgramOrder.CONTINUE))


def test_continuation_is_refused_after_the_gripper_has_moved(arm: Client) -> None:
    arm.ask(Steer(order=ProgramOrder.RUN))
    wait(arm, lambda each: each.step == 1 and each.fraction > 0.2)
    arm.ask(Steer(order=ProgramOrder.END))
    arm.go(requests.Gripper(angle=float(np.deg2rad(20.0))))
    with pytest.raises(RefusedError, match="the gripper has moved"):
        arm.ask(Steer(order=ProgramOrder.CONTINUE))


def test_program_begins_at_a_step_and_pauses_before_another(arm: Client) -> None:
    arm.ask(Breakpoints(steps=(3,)))
    arm.ask(Steer(order=ProgramOrder.RUN, at=2))
    paused = wait(arm, lambda each: each.status == "paused")
    assert (paused.step, paused.steps, paused.breakpoints) == (3, 3, (3,))
    assert posture(arm)[0] == pytest.approx(np.deg2rad(24.0), abs=1e-9)
    # A program that rests may go to another step.
    arm.ask(Breakpoints(steps=()))
    arm.ask(Steer(order=ProgramOrder.RUN, at=3))
    assert ended(arm).status == "done"
    assert posture(arm) == pytest.approx(END, abs=1e-9)


def test_step_that_does_not_exist_is_refused(arm: Client) -> None:
    arm.ask(Steer(order=ProgramOrder.RUN, at=4))
    refused = wait(arm, lambda each: each.status == "refused")
    assert "There is no step 4: Three steps has 3 steps." in refused.why
    with pytest.raises(RefusedError, match="begin at a step"):
        arm.ask(Steer(order=ProgramOrder.PAUSE, at=1))
