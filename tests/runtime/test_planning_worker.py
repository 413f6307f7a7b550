"""A change of branch is planned, or is none where two branches are one posture."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import SERVER, Actor, CommandChannel, Grounds, Person, Role
from katana450.arm.control.session import plans
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import Finding, Reason
from katana450.arm.runtime import planning_worker
from katana450.arm.runtime.pipes.state_publisher import LoopTiming, Snapshot, StatePublisher
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.errors import InputError
from katana450.maths.kinematics.branch import Branch
from katana450.maths.planning.plan import Plan
from tests.waiting import until


class Sink:
    """Keeps the commands."""

    last_ticket = 0

    def __init__(self) -> None:
        self.commands: list[cmd.Command] = []

    def deliver(self, command: cmd.Command, actor: Actor | None) -> int:  # noqa: ARG002
        self.commands.append(command)
        return 0


def planned(session: Session, elbow: float) -> tuple[PlanningWorker, list[cmd.Command]]:
    """Return the worker, and the commands, after a change to the other side of the elbow."""
    state = session.begin(np.array([0.3, -0.9, elbow, -0.6, -0.2]), 0.0, 0.0)
    sink = Sink()
    worker = PlanningWorker(session, StatePublisher(Snapshot(state, 0), LoopTiming(0.01)), sink)
    branch = state.branch
    assert isinstance(branch, Branch)
    other = "down" if branch.elbow == "up" else "up"
    worker.deliver(cmd.Branch(name=f"{branch.shoulder}-{other}"), None)
    until(lambda: not any(thread.name == "planning" for thread in threading.enumerate()), 30.0)
    return worker, sink.commands


@pytest.mark.parametrize("elbow", [0.0, -1e-9, 3e-8])
def test_stretched_elbow_is_on_both_branches(session: Session, elbow: float) -> None:
    worker, commands = planned(session, elbow)
    assert worker.failure == ""
    assert commands == []


def test_bent_elbow_follows_a_plan(session: Session) -> None:
    worker, commands = planned(session, 0.4)
    assert worker.failure == ""
    (follow,) = commands
    assert isinstance(follow, cmd.Follow)
    assert follow.plan.duration > 0.1


def test_unknown_branch_is_refused_before_a_path_is_planned(session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    sink = Sink()
    worker = PlanningWorker(session, StatePublisher(Snapshot(state, 0), LoopTiming(0.01)), sink)
    with pytest.raises(InputError, match="front-up, front-down"):
        worker.deliver(cmd.Branch(name="sideways"), None)
    assert not worker.busy
    assert sink.commands == []


@pytest.mark.parametrize(
    ("command", "notes"), [(cmd.Stop(), []), (cmd.Hold(), [planning_worker.SUPERSEDED])]
)
def test_path_that_is_found_after_another_command_is_not_followed(
    session: Session, monkeypatch: pytest.MonkeyPatch, command: cmd.Command, notes: list[str]
) -> None:
    free, stopped = threading.Event(), threading.Event()

    def plan_to(*arguments: Any) -> Plan:
        plan = plans.plan_to(*arguments)
        free.set()
        stopped.wait(30.0)
        return plan

    monkeypatch.setattr(planning_worker, "plan_to", plan_to)
    state = session.begin(np.array([0.3, -0.9, 0.4, -0.6, -0.2]), 0.0, 0.0)
    sink = Sink()
    worker = PlanningWorker(session, StatePublisher(Snapshot(state, 0), LoopTiming(0.01)), sink)
    worker.deliver(cmd.Branch(name="front-down"), None)
    assert free.wait(30.0)
    said: list[str] = []
    worker.notify = said.append
    worker.deliver(command, None)
    assert said == notes
    (thread,) = (running for running in threading.enumerate() if running.name == "planning")
    stopped.set()
    thread.join(30.0)
    assert sink.commands == [command]


PERSON = Actor(Person("1", "Ada", Role.OPERATOR), CommandChannel.PAGE)
PROTECTION = replace(SERVER, grounds=Grounds.SERVER)
PAUSE = cmd.HoldFor(Finding(Reason.PAUSED))


@pytest.mark.parametrize(
    ("command", "actor", "calls"),
    [
        (cmd.Hold(), PROTECTION, 0),
        (PAUSE, PROTECTION, 1),
        (cmd.Hold(), PERSON, 1),
        (cmd.Home(), PERSON, 1),
        (cmd.Speed(0.5), PERSON, 0),
    ],
    ids=["driver left", "pause by the server", "hold", "motion", "speed"],
)
def test_run_that_waits_is_kept_only_when_another_driver_leaves(
    session: Session, command: cmd.Command, actor: Actor, calls: int
) -> None:
    state = session.begin(np.array([0.3, -0.9, 0.4, -0.6, -0.2]), 0.0, 0.0)
    sink = Sink()
    worker = PlanningWorker(session, StatePublisher(Snapshot(state, 0), LoopTiming(0.01)), sink)
    heard: list[str] = []
    worker.redirected = lambda: heard.append("redirected")
    worker.deliver(command, actor)
    assert len(heard) == calls
    assert sink.commands == [command]
