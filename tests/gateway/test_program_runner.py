"""Test the program runner with a simulated clock: owner, lease, pauses and stops."""

from __future__ import annotations

import threading
from argparse import Namespace
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import CommandChannel, Grounds, Role
from katana450.arm.control.session.session import Session
from katana450.errors import InputError, LeaseError
from katana450.extensions.programs.building.actions import ACTION_TIMEOUT
from katana450.extensions.programs.serve_options import OWNER_SILENCE
from katana450.extensions.programs.server.program_planner import Planning
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.server.api import answers
from katana450.server.api.program_requests import ProgramOrder, Steer
from katana450.server.service import status
from katana450.server.service.budget import Budgets
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from tests.gateway.test_hub import PAGES, Table
from tests.waiting import until

SCRIPT = "name: Wave\nsteps:\n  - wait: 30\n  - joints: [20, -60, 80, 8, 0]\n"


def made(hub: Hub) -> ProgramRunner:
    """Make the runner as ``katana450 serve`` does."""
    return ProgramRunner(hub, Namespace(owner_silence=OWNER_SILENCE))


class Staged(Table):
    """A table with an arm for which programs can be planned."""

    def __init__(self, session: Session) -> None:
        super().__init__(session.begin(session.ready, 0.0, 0.0), made)
        self.arm.session, self.arm.arm = session, Mock(T_base_shoulder=np.eye(4))
        assert isinstance(self.hub.runner, ProgramRunner)
        self.programs = self.hub.runner

    @property
    def progress(self) -> answers.Progress:
        """Progress of the program; there must be one."""
        progress = self.programs.progress()
        assert progress is not None
        return progress

    def bar(self, participant: Participant) -> dict[str, Any]:
        """Return what the bar of the page of ``participant`` shows."""
        return status.common(self.hub) | status.of(self.hub, participant)

    @property
    def status(self) -> str:
        progress = self.programs.progress()
        return "" if progress is None else progress.status

    def plan(self, participant: Participant, script: str = SCRIPT) -> None:
        """Plan ``script`` and wait for the planning thread."""
        self.programs.script(participant, script, more=False, speed=1.0)
        until(lambda: self.status != "planning", 60.0)

    def run(self, participant: Participant, script: str = SCRIPT) -> None:
        """Plan ``script`` and begin it."""
        self.plan(participant, script)
        self.programs.steer(participant, ProgramOrder.RUN)


@pytest.fixture
def table(session: Session) -> Staged:
    return Staged(session)


def test_program_time_passes_while_the_state_is_unchanged(table: Staged) -> None:
    """Use an arm at rest, whose state is unchanged, its time included."""
    participant = table.join(PAGES[0])
    table.run(participant)
    table.wait(29.0, participant)
    assert not any(isinstance(command, cmd.Follow) for command in table.arm.commands)
    table.wait(2.0, participant)
    assert any(isinstance(command, cmd.Follow) for command in table.arm.commands)


def test_pause_does_not_count_towards_the_timeout(table: Staged) -> None:
    participant = table.join(PAGES[0])
    table.run(participant, "steps:\n  - gripper: open\n")
    rest = table.arm.rest
    table.arm.rest = replace(rest, gripper_goal=rest.gripper_goal + 0.5)
    table.wait(0.1, participant)
    # The fingers rest on their path, and no new state comes before ``resume``.
    table.arm.rest = replace(table.arm.rest, paused=True)
    table.wait(2.0 * ACTION_TIMEOUT, participant)
    assert table.status == "paused"
    table.arm.rest = replace(table.arm.rest, t=rest.t + 2.0 * ACTION_TIMEOUT + 0.1, paused=False)
    table.wait(0.1, participant)
    assert table.status == "running"
    table.wait(ACTION_TIMEOUT, participant)
    assert table.status == "failed"


def test_others_may_steer_a_program_only_if_they_may_take_the_lease(table: Staged) -> None:
    owner, other = (table.join(page, Role.OPERATOR) for page in PAGES)
    viewer, admin = table.join("third", Role.VIEWER), table.join("fourth", Role.ADMIN)
    program_runner = table.programs
    for more in (False, True):
        with pytest.raises(LeaseError, match="watch"):
            program_runner.script(viewer, SCRIPT, more=more, speed=1.0)
    table.plan(owner)
    program_runner.steer(owner, ProgramOrder.RUN)
    for participant, reason in ((viewer, "watch"), (other, "belongs to Window 1")):
        with pytest.raises(LeaseError, match=reason):
            program_runner.steer(participant, ProgramOrder.END)
    with pytest.raises(LeaseError, match="End it first"):
        table.plan(other)
    program_runner.steer(admin, ProgramOrder.END)
    assert table.status == "stopped"
    assert table.hub.lease.holder is None


def test_program_does_not_take_the_lease_from_a_driver(table: Staged) -> None:
    owner, other = (table.join(page) for page in PAGES)
    table.plan(owner)
    table.touch(other.person.key)
    with pytest.raises(LeaseError, match="Window 2 holds the arm"):
        table.programs.steer(owner, ProgramOrder.RUN)
    assert len(table.hub.participants) == 2
    assert table.hub.lease.holder == other.person


def test_stop_and_a_closed_page_end_a_program(table: Staged) -> None:
    participant = table.join(PAGES[0])
    table.run(participant)
    table.stop("Somebody")
    table.wait(0.1, participant)
    assert table.status == "stopped"
    table.hub.move(participant, cmd.ClearStop())
    table.hub.release_lease(participant)
    table.programs.steer(participant, ProgramOrder.RUN)
    table.wait(0.5, participant)
    table.hub.leave(participant)
    table.wait(0.5)
    assert table.status == "running"
    table.wait(1.0)
    assert table.status == "stopped"
    assert table.arm.holds > 0


def test_stop_that_another_person_clears_leaves_the_lease_to_the_owner(table: Staged) -> None:
    owner, other = (table.join(page) for page in PAGES[:2])
    table.run(owner)
    table.stop("Somebody")
    table.wait(0.1, owner)
    table.hub.move(other, cmd.ClearStop())
    assert table.arm.actors[-1].grounds is Grounds.NO_DRIVER
    assert table.hub.lease.holder is None
    table.programs.steer(owner, ProgramOrder.RUN)
    assert table.status == "running"
    # Without an interrupted program the lease is for the person who clears the stop.
    table.stop("Somebody")
    table.wait(0.1, owner)
    table.hub.gate.acquire(other.actor)
    table.hub.release_lease(other)
    table.hub.move(other, cmd.ClearStop())
    assert table.hub.lease.holder == other.person


MOVES = (cmd.Joint(1, 0.2), cmd.Jog(np.array((0.05, 0.0, 0.0, 0.0, 0.0))))


@pytest.mark.parametrize("move", MOVES, ids=lambda move: type(move).__name__)
def test_owner_takes_over_by_moving_the_arm(table: Staged, move: cmd.Command) -> None:
    owner, other = (table.join(page, Role.OPERATOR) for page in PAGES)
    table.run(owner)
    table.wait(0.1, owner)
    began = owner.actor
    holds, session = table.arm.holds, table.arm.session
    for actor, command in (
        (other.actor, move),
        # No end of a gesture takes over, nor the gripper, nor a program of the API.
        (began, cmd.Jog(np.zeros(5))),
        (began, cmd.EndDrag()),
        (began, cmd.Gripper(0.3)),
        (replace(began, channel=CommandChannel.TCP), move),
    ):
        with pytest.raises(LeaseError, match="Wave holds the arm"):
            table.hub.gate.submit(command, actor)
    with pytest.raises(InputError, match="no axis 9"):
        table.hub.move(owner, cmd.Joint(9, 0.2))
    with pytest.raises(LeaseError, match="Nobody has taken over"):
        table.programs.steer(owner, ProgramOrder.REWIND)
    table.hub.move(owner, move)
    table.arm.rest = session.begin(session.ready + 0.05, 0.0, 0.0)
    table.hub.gate.submit(move, replace(began, seen=table.hub.gate.revocations))
    table.wait(0.1, owner)
    assert (table.status, table.arm.holds) == ("stopped", holds + 1)
    assert table.hub.lease.holder == owner.person
    assert table.bar(owner)["why"].startswith("You took over at step 1 of 2. Continue resumes")
    assert table.bar(owner)["orders"] == ["continue", "rewind"]
    with pytest.raises(LeaseError, match="belongs to Window 1"):
        table.programs.steer(other, ProgramOrder.REWIND)
    table.programs.steer(owner, ProgramOrder.REWIND)
    restored = table.arm.commands[-1]
    assert isinstance(restored, cmd.RestoreState)
    np.testing.assert_array_equal(restored.state.setpoint, session.ready)
    assert table.arm.holds == holds + 2


def test_owner_sets_the_arm_back_while_the_program_runs(table: Staged) -> None:
    owner, session = table.join(PAGES[0]), table.arm.session
    table.run(owner)
    table.wait(0.1, owner)
    table.hub.move(owner, cmd.RestoreState(session.begin(session.ready, 0.0, 0.0), "ring"))
    table.wait(0.1, owner)
    assert table.hub.lease.holder == owner.person
    assert table.bar(owner)["why"].startswith("The arm continues from an earlier moment at step 1")
    assert table.bar(owner)["orders"] == ["continue", "rewind"]
    table.programs.steer(owner, ProgramOrder.CONTINUE)
    assert table.status == "running"


def test_handle_is_grabbed_before_its_first_command_takes_over(table: Staged) -> None:
    owner = table.join(PAGES[0])
    table.run(owner)
    gesture = table.hub.at_scene(owner.person.key, table.hub.gate.revocations)
    claimed = table.hub.gate.claim(gesture, of_arm=True)
    assert table.status == "running"
    table.hub.gate.submit(cmd.Joint(1, 0.2), claimed)
    table.wait(0.1, owner)
    assert (table.status, table.hub.gate.is_current(claimed)) == ("stopped", True)


def test_run_from_before_a_stop_is_not_executed_after_it(
    table: Staged, monkeypatch: pytest.MonkeyPatch
) -> None:
    participant = table.join(PAGES[0])
    cleared = threading.Event()
    # The stop comes while the script is being planned, however fast that is.
    monkeypatch.setattr(Planning, "_check", lambda _: cleared.wait(60.0))
    table.programs.script(participant, SCRIPT, more=False, speed=1.0)
    table.programs.steer(participant, ProgramOrder.RUN)
    revocations = table.hub.gate.revocations
    table.stop("Anybody")
    table.hub.move(participant, cmd.ClearStop())
    # An order that waited in the socket meanwhile.
    dispatcher = Dispatcher(table.hub)
    late = Steer(order=ProgramOrder.RUN, revocations=revocations)
    with pytest.raises(LeaseError, match="Do it again"):
        dispatcher.handle(participant, late, Budgets(table.hub.clock).of("page"))
    cleared.set()
    until(lambda: table.status != "planning", 60.0)
    table.wait(1.0, participant)
    assert table.status == "ready"
    assert not table.programs.running


def test_program_of_the_driver_supersedes_the_planning_of_another(table: Staged) -> None:
    planner, driver = (table.join(page, Role.OPERATOR) for page in PAGES)
    long = "steps:\n  - repeat: {times: 300, steps: [{arc: {centre: {x: 300, y: 0, z: 0}, axis: x"
    long += ", angle: 3600}}]}\n"
    table.programs.script(planner, long, more=False, speed=1.0)
    with pytest.raises(LeaseError, match="being planned"):
        table.plan(driver)
    table.touch(driver.person.key)
    with pytest.raises(LeaseError, match="being planned"):
        table.programs.script(planner, SCRIPT, more=False, speed=1.0)
    table.plan(driver)
    progress = table.progress
    assert (progress.status, progress.by) == ("ready", "Window 2")
    (notice,) = table.notices_of[PAGES[0]]
    assert "Window 2, who drives, has sent another program." in notice["why"]


def test_program_ends_without_its_owner(table: Staged) -> None:
    table.run(table.join(PAGES[0]))
    table.wait(2.0 * OWNER_SILENCE)
    assert table.status == "stopped"


def test_owner_must_be_there_when_a_planned_program_begins(table: Staged, session: Session) -> None:
    """The owner falls silent before the planning ends: nothing begins to move."""
    owner = table.join(PAGES[0])
    table.plan(owner)
    # Another situation, so that the script is planned again before it runs.
    table.arm.rest = session.begin(session.ready + 0.05, 0.0, 0.0)
    table.programs.handle(owner, Steer(order=ProgramOrder.RUN))
    assert not table.programs.running
    table.t += 2.0 * OWNER_SILENCE
    table.hub.tick()
    until(lambda: table.status != "planning", 60.0)
    table.wait(1.0)
    assert table.status == "ready"
    assert not table.programs.running
