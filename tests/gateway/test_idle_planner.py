"""Test that the scripts of the library are planned while nobody uses the server."""

from __future__ import annotations

import time
from dataclasses import replace
from unittest.mock import Mock

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.extensions.programs.script.script_files import LIBRARY, script_text
from katana450.extensions.programs.server import idle_planner, program_planner
from katana450.extensions.programs.server.idle_planner import IdlePlanner
from katana450.server.api.program_requests import ProgramOrder
from tests.gateway.test_hub import PAGES
from tests.gateway.test_planning import Slow, slow
from tests.gateway.test_program_runner import SCRIPT, Staged

__all__ = ["slow"]

OTHER = SCRIPT.replace("Wave", "Nod")
WAIT = idle_planner.DELAY + 1.0


@pytest.fixture
def table(session: Session, monkeypatch: pytest.MonkeyPatch) -> Staged:
    staged = Staged(session)
    monkeypatch.setattr(idle_planner, "_texts", lambda _arm: [SCRIPT, OTHER])
    staged.arm.robot = Mock()
    return staged


def watch(table: Staged) -> None:
    """Let one page of the table get pictures."""
    table.hub.pictures.show(PAGES[0], Mock())


def wait_for_planning(table: Staged) -> None:
    due = time.monotonic() + 30.0
    while idle(table)._plannings[0].busy and time.monotonic() < due:
        time.sleep(0.01)
    assert idle(table)._plannings[0].program is not None


def idle(table: Staged) -> IdlePlanner:
    found = table.programs.planner._idle
    assert found is not None
    return found


def test_planned_script_runs_at_once(table: Staged, monkeypatch: pytest.MonkeyPatch) -> None:
    participant = table.join(PAGES[0])
    watch(table)
    table.wait(WAIT, participant)
    wait_for_planning(table)
    prepared = idle(table)._plannings[0]

    def never(*_: object, **__: object) -> None:
        raise AssertionError("it was planned again")

    monkeypatch.setattr(program_planner, "compiled", never)
    table.programs.script(participant, SCRIPT, more=False, speed=1.0)
    assert table.programs.planner.planning is prepared
    assert table.status == "ready"
    table.programs.steer(participant, ProgramOrder.RUN)
    assert table.programs.running


def test_a_script_that_is_being_planned_is_not_begun_anew(table: Staged, slow: Slow) -> None:
    participant = table.join(PAGES[0])
    watch(table)
    table.wait(WAIT, participant)
    table.programs.script(participant, SCRIPT, more=False, speed=1.0)
    assert slow.begun == 1
    assert table.status == "planning"


def test_nothing_is_planned_for_nobody(table: Staged, slow: Slow) -> None:
    participant = table.join(PAGES[0])
    table.wait(WAIT, participant)
    assert slow.begun == 0


@pytest.mark.parametrize("use", ["command", "motion", "script"])
@pytest.mark.usefixtures("slow")
def test_use_of_the_server_ends_the_planning(table: Staged, use: str) -> None:
    participant = table.join(PAGES[0])
    watch(table)
    table.wait(WAIT, participant)
    (planning,) = idle(table)._plannings
    if use == "command":
        table.hub.move(participant, cmd.Home())
        table.programs.redirected()
    elif use == "motion":
        rest = table.arm.rest
        table.arm.rest = replace(rest, gripper_goal=rest.gripper_goal + 0.5)
        table.wait(0.2, participant)
    else:
        table.programs.script(participant, OTHER, more=False, speed=1.0)
        table.wait(0.2, participant)
    assert planning.cancelled is not None
    assert planning not in idle(table)._plannings


def test_a_plan_for_another_scene_is_not_used(table: Staged) -> None:
    participant = table.join(PAGES[0])
    watch(table)
    table.wait(WAIT, participant)
    wait_for_planning(table)
    prepared = idle(table)._plannings[0]
    table.arm.rest = replace(table.arm.rest, tool="flange")
    table.programs.script(participant, SCRIPT, more=False, speed=1.0)
    assert table.programs.planner.planning is not prepared


def test_library_is_planned_with_the_pour_first(session: Session) -> None:
    texts = idle_planner._texts(session.require_arm())
    assert texts[0] == script_text(LIBRARY / "pour.yaml")
    assert len(texts) == len(list(LIBRARY.glob("*.yaml"))) - 1


def test_command_during_the_start_of_a_planning_cancels_it(session: Session) -> None:
    planning = Mock(text=SCRIPT, cancelled=None, busy=True)

    def plan(_text: str, _speed: float) -> Mock:
        planner.cancel()
        return planning

    planner = IdlePlanner(plan, session.require_arm())
    state = session.begin(session.ready, 0.0, 0.0)
    planner.tick(state, 0.0, used=True)
    planner.tick(state, WAIT, used=False)
    planning.cancel.assert_called_once()
