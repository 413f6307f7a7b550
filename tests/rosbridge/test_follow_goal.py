"""A goal that is followed ends only when its program can no longer run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from katana450.errors import LeaseError
from katana450.extensions.rosbridge.follow_goal import FollowGoal
from katana450.extensions.rosbridge.goals import GoalHost, GoalStatus
from katana450.extensions.rosbridge.messages import FollowJointTrajectoryResult
from katana450.extensions.rosbridge.ops import SendActionGoal
from katana450.server.api import answers
from katana450.server.service.participants import Participant
from katana450.server.service.runner import Runner
from tests.rosbridge.ros_client import FOLLOW, JOINTS, trajectory

AWAY = [0.4, -1.1, 1.4, 0.2, 0.3]


class WaitingRunner(Runner):
    """A runner whose planned program runs in the next tick, if ``waits``."""

    def __init__(self) -> None:
        self.waits = True
        self.owned = True
        self.status = "ready"
        self.ended: list[str] = []
        self.name = ""

    def progress(self) -> answers.Progress:
        # A script has no name until its thread has read it.
        why = "Line 2, trajectory: Asked to take 0.01 s, it takes 1.56 s: why."
        return answers.Progress(name=self.name, by="A client", status=self.status, why=why)

    def owns(self, participant: Participant) -> bool:  # noqa: ARG002
        return self.owned

    def runs_for(self, participant: Participant) -> bool:  # noqa: ARG002
        return self.waits

    def end(self, participant: Participant, why: str) -> None:  # noqa: ARG002
        self.ended.append(why)


@pytest.fixture
def runner() -> WaitingRunner:
    return WaitingRunner()


@pytest.fixture
def goal(runner: WaitingRunner) -> FollowGoal:
    """A goal whose program was started, and was planned again because the scene changed."""
    state = SimpleNamespace(setpoint=np.zeros(5), q=np.zeros(5))
    arm = SimpleNamespace(state=state, arm=SimpleNamespace(chain=SimpleNamespace(names=JOINTS)))
    hub: Any = SimpleNamespace(runner=runner, present=lambda: arm)
    participant: Any = SimpleNamespace()
    host = GoalHost(hub, participant, lambda _: answers.Done(), lambda _: None, lambda *_: None)
    args = msgspec.json.encode(trajectory((1.0, AWAY)))
    op = SendActionGoal(action=FOLLOW, args=msgspec.Raw(args), id="goal 1")
    found = FollowGoal(host, op)
    found._runs = True
    return found


def test_program_that_runs_with_the_next_tick_is_not_reported_as_cancelled(
    goal: FollowGoal, runner: WaitingRunner
) -> None:
    assert goal.follow() is None
    runner.waits = False
    result = goal.follow()
    assert result is not None
    assert result.status is GoalStatus.CANCELED


def test_result_says_which_time_was_not_kept(goal: FollowGoal, runner: WaitingRunner) -> None:
    runner.status = "done"
    result = goal.follow()
    assert result is not None
    assert result.status is GoalStatus.SUCCEEDED
    assert isinstance(result.values, FollowJointTrajectoryResult)
    assert result.values.error_string == "Asked to take 0.01 s, it takes 1.56 s: why."


def test_cancel_voids_the_run_that_waits(goal: FollowGoal, runner: WaitingRunner) -> None:
    assert goal.end("The client cancelled it.").status is GoalStatus.CANCELED
    assert runner.ended == ["The client cancelled it"]


def test_goal_before_the_arm_is_ready_is_aborted_with_the_reason(runner: WaitingRunner) -> None:
    sent: list[dict[str, Any]] = []

    def present() -> None:
        raise LeaseError("The arm is not ready yet.")

    hub: Any = SimpleNamespace(
        runner=runner,
        present=present,
        arm=None,
        clock=lambda: 0.0,
        gate=SimpleNamespace(revocations=0, check_not_stopped=lambda: None),
    )
    participant: Any = SimpleNamespace()
    host = GoalHost(hub, participant, lambda _: answers.Done(), sent.append, lambda *_: None)
    args = msgspec.json.encode(trajectory((1.0, AWAY)))
    found = FollowGoal(host, SendActionGoal(action=FOLLOW, args=msgspec.Raw(args), id="goal 1"))
    found.begin()
    found.tick()
    assert found.ended
    (result,) = sent
    assert result["status"] == GoalStatus.ABORTED
    assert result["values"].error_string == "The arm is not ready yet."


def test_cancel_leaves_the_unread_program_of_another_client(
    goal: FollowGoal, runner: WaitingRunner
) -> None:
    runner.status, runner.owned = "planning", False
    assert goal.end("The client cancelled it.").status is GoalStatus.CANCELED
    assert runner.ended == []
    result = goal.follow()
    assert result is not None
    assert result.status is GoalStatus.CANCELED
