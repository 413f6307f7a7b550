"""Test pause, hold, stop and cancel while a program is planned, and the kept plan."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import LeaseError
from katana450.extensions.programs.run.compiler import TIMING, PlanningStage
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.server import program_planner
from katana450.maths.geometry import se3
from katana450.maths.planning.checkpoint import checkpoint
from katana450.server.api.program_requests import Preview, ProgramOrder
from katana450.server.service.participants import Participant
from tests.gateway.test_hub import PAGES
from tests.gateway.test_program_runner import SCRIPT, Staged
from tests.waiting import until

PROMPT = 0.5
"""Maximum time [s] until a cancelled planning has ended."""


class Slow:
    """A planning that lasts until it is released."""

    def __init__(self) -> None:
        self.released = threading.Event()
        self.begun = 0
        self._compiled = compiled

    def compiled(self, *args: Any, **options: Any) -> Any:
        self.begun += 1
        args[-1](PlanningStage(TIMING, 1, 2))
        while not self.released.wait(0.002):
            checkpoint()
        return self._compiled(*args, **options)


@pytest.fixture
def table(session: Session) -> Staged:
    return Staged(session)


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Iterator[Slow]:
    slow = Slow()
    monkeypatch.setattr(program_planner, "compiled", slow.compiled)
    yield slow
    slow.released.set()


def ask(
    table: Staged, participant: Participant, then: ProgramOrder | None = ProgramOrder.RUN
) -> None:
    """Request ``SCRIPT``, and what follows its planning, as the page does."""
    table.programs.script(participant, SCRIPT, more=False, speed=1.0)
    if then is not None:
        table.programs.steer(participant, then)
    table.wait(0.1, participant)


def finish(table: Staged, participant: Participant, slow: Slow) -> None:
    slow.released.set()
    until(lambda: table.status != "planning", 60.0)
    table.wait(0.2, participant)


def followed(table: Staged) -> bool:
    return any(isinstance(command, cmd.Follow) for command in table.arm.commands)


def first_progress(table: Staged, participant: Participant) -> dict[str, Any]:
    """Return the bar once the planning thread has reported its first step."""
    due = time.monotonic() + 10.0
    while (shown := table.bar(participant))["headline"] == "Planning the script 0 %":
        assert time.monotonic() < due
        time.sleep(0.005)
    return shown


def test_pause_during_planning_starts_the_program_paused(table: Staged, slow: Slow) -> None:
    participant = table.join(PAGES[0])
    ask(table, participant)
    first_progress(table, participant)
    table.programs.steer(participant, ProgramOrder.PAUSE)
    assert isinstance(table.arm.commands[-1], cmd.Pause)
    table.arm.rest = replace(table.arm.rest, paused=True)
    shown = table.bar(participant)
    assert shown["headline"] == "Planning Wave 20 %"
    assert shown["why"].startswith("Paused. Step 1 of 2: timing paths.")
    assert shown["why"].endswith("Then it waits for Resume.")
    assert (shown["paused"], shown["pace"], shown["orders"]) == (True, "", ["end"])
    finish(table, participant, slow)
    assert table.status == "paused"
    shown = table.bar(participant)
    assert (shown["mood"], shown["headline"]) == ("paused", "Paused")
    assert shown["why"].startswith("Wave: speed, step 1 of 2")
    assert not any(isinstance(command, cmd.Resume) for command in table.arm.commands)
    table.wait(60.0, participant)
    assert not followed(table)
    table.programs.steer(participant, ProgramOrder.RESUME)
    assert isinstance(table.arm.commands[-1], cmd.Resume)
    table.arm.rest = replace(table.arm.rest, paused=False)
    table.wait(0.1, participant)
    assert table.status == "running"


def test_run_of_a_finished_plan_does_not_end_a_pause(table: Staged) -> None:
    participant = table.join(PAGES[0])
    table.plan(participant)
    table.arm.rest = replace(table.arm.rest, paused=True)
    table.programs.steer(participant, ProgramOrder.RUN)
    table.wait(60.0, participant)
    assert table.status == "paused"
    assert not followed(table)


def test_other_commands_during_planning_keep_the_program_from_running(
    table: Staged, slow: Slow
) -> None:
    participant = table.join(PAGES[0])
    ask(table, participant)
    table.programs.redirected()
    assert "does not start by itself" in table.bar(participant)["why"]
    finish(table, participant, slow)
    progress = table.progress
    assert progress.status == "ready"
    assert progress.why.startswith("Not run: the arm was given another command")
    assert not table.programs.running


def test_run_requested_during_a_stop_is_refused(table: Staged, slow: Slow) -> None:
    participant = table.join(PAGES[0])
    ask(table, participant, None)
    table.stop("Anybody")
    program_runner = table.programs
    with pytest.raises(LeaseError, match="clear the stop first"):
        program_runner.steer(participant, ProgramOrder.RUN)
    finish(table, participant, slow)
    q = table.arm.rest.setpoint + 0.01
    motion = replace(table.arm.rest.motion, q=q)
    table.arm.rest = replace(table.arm.rest, q=q, goal=q, motion=motion)
    with pytest.raises(LeaseError, match="clear the stop first"):
        program_runner.steer(participant, ProgramOrder.RUN)
    table.hub.move(participant, cmd.ClearStop())
    table.wait(1.0, participant)
    assert table.status == "ready"
    assert not program_runner.running


def test_run_request_during_planning_takes_effect_afterwards(table: Staged, slow: Slow) -> None:
    participant, other = (table.join(page, Role.OPERATOR) for page in PAGES)
    ask(table, participant, None)
    assert table.bar(participant)["orders"] == ["end"]
    assert table.bar(other)["orders"] == []
    for order in ProgramOrder:
        with pytest.raises(LeaseError, match="belongs to Window 1"):
            table.programs.steer(other, order)
    table.programs.steer(participant, ProgramOrder.RUN)
    finish(table, participant, slow)
    assert table.status == "running"


def test_cancelled_planning_ends_promptly_and_frees_the_planner(table: Staged, slow: Slow) -> None:
    participant, other = (table.join(page) for page in PAGES)
    ask(table, participant)
    job = table.programs.planner.planning
    assert job is not None
    with pytest.raises(LeaseError, match="being planned"):
        table.programs.script(other, SCRIPT, more=False, speed=1.0)
    table.programs.steer(participant, ProgramOrder.END)
    assert table.status == "cancelled"
    table.programs.script(other, SCRIPT, more=False, speed=1.0)
    assert table.status == "planning"
    job.thread.join(PROMPT)
    assert not job.thread.is_alive()
    finish(table, other, slow)
    assert table.status == "ready"
    assert not table.programs.running


def test_planning_of_a_departed_owner_is_cancelled(table: Staged, slow: Slow) -> None:
    participant, other = (table.join(page) for page in PAGES)
    ask(table, participant)
    table.hub.leave(participant)
    table.wait(2.0, other)
    assert not table.programs.waits
    table.programs.script(other, SCRIPT, more=False, speed=1.0)
    finish(table, other, slow)
    progress = table.progress
    assert (progress.status, progress.by) == ("ready", other.person.name)


def test_preview_ends_with_the_window_that_made_it(table: Staged, slow: Slow) -> None:
    participant, other = (table.join(page) for page in PAGES)
    ask(table, participant, then=None)
    finish(table, participant, slow)
    table.programs.handle(participant, Preview(at=0.1))
    table.wait(0.1, participant, other)
    assert table.programs.look_time == 0.1
    assert table.programs.drawn is not None
    table.hub.leave(participant)
    table.wait(0.1, other)
    assert table.programs.look_time == 0.0
    assert table.programs.drawn is None


def test_kept_plan_is_run_without_planning_again(table: Staged, slow: Slow) -> None:
    slow.released.set()
    participant = table.join(PAGES[0])
    ask(table, participant, None)
    finish(table, participant, slow)
    before = table.programs.program
    ask(table, participant)
    assert table.status == "running"
    assert table.programs.program is before
    assert slow.begun == 1
    table.programs.steer(participant, ProgramOrder.END)
    table.programs.script(participant, SCRIPT, more=False, speed=0.5)
    finish(table, participant, slow)
    assert slow.begun == 2


@pytest.mark.parametrize("moved", ["arm", "scene", "gripper"])
def test_change_causes_new_planning_with_the_reason(table: Staged, slow: Slow, moved: str) -> None:
    slow.released.set()
    participant = table.join(PAGES[0])
    ask(table, participant, None)
    finish(table, participant, slow)
    rest = table.arm.rest
    match moved:
        case "arm":
            q = rest.setpoint + np.array((0.01, 0.0, 0.0, 0.0, 0.0))
            table.arm.rest = replace(rest, q=q, goal=q, motion=replace(rest.motion, q=q))
        case "gripper":
            table.arm.rest = replace(rest, gripper=0.1, gripper_setpoint=0.1, gripper_goal=0.1)
        case "scene":
            T = se3.from_rotation_translation(np.eye(3), np.array((0.0, -0.8, 0.0)))
            box = SceneObject("box", Shape.BOX, (0.05, 0.05, 0.05), T)
            table.arm.rest = replace(rest, objects=(box,))
    slow.released.clear()
    table.programs.steer(participant, ProgramOrder.RUN)
    progress = table.progress
    assert progress.status == "planning"
    assert moved in progress.why
    assert moved in table.bar(participant)["why"]
    finish(table, participant, slow)
    assert (table.status, slow.begun) == ("running", 2)


def test_bar_shows_the_progress_of_planning(table: Staged, slow: Slow) -> None:
    participant = table.join(PAGES[0])
    ask(table, participant, None)
    shown = first_progress(table, participant)
    assert (shown["mood"], shown["headline"]) == ("planning", "Planning Wave 20 %")
    assert shown["why"] == "Step 1 of 2: timing paths. It does not start by itself."
    table.arm.moves = True
    shown = table.bar(participant)
    assert (shown["mood"], shown["headline"]) == ("moving", "Moving to the target")
    assert shown["why"].startswith("Planning Wave. Step 1 of 2")
    table.arm.moves = False
    table.stop("Anybody")
    assert table.bar(participant)["mood"] == "stopped"
    table.hub.move(participant, cmd.ClearStop())
    finish(table, participant, slow)
    assert table.bar(participant)["headline"] == "On target"


def test_owner_pauses_resumes_and_slows_a_program(table: Staged) -> None:
    owner, other = (table.join(page) for page in PAGES)
    table.plan(owner)
    program_runner, hub = table.programs, table.hub
    program_runner.steer(owner, ProgramOrder.RUN)
    hub.move(owner, cmd.Pause())
    assert isinstance(table.arm.commands[-1], cmd.Pause)
    hub.move(owner, cmd.Speed(0.5))
    assert table.arm.fraction == 0.5
    with pytest.raises(LeaseError, match="Wave holds the arm"):
        hub.move(other, cmd.Pause())
    with pytest.raises(LeaseError, match="Wave holds the arm"):
        hub.move(other, cmd.Speed(1.0))
    assert (table.bar(owner)["orders"], table.bar(owner)["pace"]) == (["end"], "")
    assert table.bar(other)["orders"] == []
    assert table.bar(other)["pace"] == "Wave drives: ask for the arm."
    # The page of the owner is reloaded.
    hub.leave(owner)
    again = table.join(PAGES[0])
    hub.move(again, cmd.Resume())


def test_speed_set_by_a_person_lasts_until_the_program_ends(table: Staged) -> None:
    participant = table.join(PAGES[0])
    table.run(participant, "steps:\n  - wait: 1\n  - speed: 0.8\n  - wait: 1\n")
    table.wait(0.5, participant)
    table.arm.rest = replace(table.arm.rest, speed=0.3)
    table.wait(3.0, participant)
    speeds = [command.value for command in table.arm.commands if isinstance(command, cmd.Speed)]
    assert speeds == [1.0, 0.3]
    assert table.status == "done"
    assert table.arm.fraction == 0.3


@pytest.mark.parametrize("ends", ["done", "ended", "STOP", "continued"])
def test_tool_frame_is_restored_at_every_end_of_a_program(table: Staged, ends: str) -> None:
    participant, before = table.join(PAGES[0]), table.arm.state.tool
    table.run(participant, "steps:\n  - tool: flange\n  - wait: 1\n")
    table.wait(0.5, participant)
    table.arm.rest = replace(table.arm.rest, tool="flange")
    if ends == "ended":
        table.programs.steer(participant, ProgramOrder.END)
    elif ends in {"STOP", "continued"}:
        table.stop("Anybody")
        table.wait(0.2, participant)
        # Nothing is selected before the stop is cleared.
        assert [command for command in table.arm.commands if command == cmd.Tool(before)] == []
        table.hub.move(participant, cmd.ClearStop())
        if ends == "continued":
            table.programs.steer(participant, ProgramOrder.CONTINUE)
    table.wait(3.0, participant)
    assert table.status == ("done" if ends in {"done", "continued"} else "stopped")
    chosen = [command.name for command in table.arm.commands if isinstance(command, cmd.Tool)]
    assert chosen == ["flange", *(["flange"] if ends == "continued" else []), before]
