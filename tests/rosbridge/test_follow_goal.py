"""The end of a motion becomes the result of its goal, and a cancel ends the program."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from katana450.arm.control.lease import Actor, CommandChannel, Person, Role
from katana450.errors import LeaseError
from katana450.extensions.rosbridge.goals import (
    ErrorCode,
    FollowGoal,
    GoalError,
    GoalHost,
    GoalStatus,
)
from katana450.extensions.rosbridge.protocol import SendActionGoal
from katana450.server.api import answers
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.participants import Participant
from katana450.server.service.runner import Runner
from tests.rosbridge.ros_client import FOLLOW, trajectory

AWAY = [0.4, -1.1, 1.4, 0.2, 0.3]


class RecordedRunner(Runner):
    """A runner with a program of a given status."""

    def __init__(self) -> None:
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
        return True

    def end(self, participant: Participant, why: str) -> None:  # noqa: ARG002
        self.ended.append(why)


@pytest.fixture
def runner() -> RecordedRunner:
    return RecordedRunner()


@pytest.fixture
def goal(runner: RecordedRunner) -> FollowGoal:
    """A goal whose program was sent."""
    hub: Any = SimpleNamespace(runner=runner, gate=SimpleNamespace(revocations=0))
    goal = made(hub, [])
    goal._is_sent = True
    return goal


def made(hub: Any, sent: list[dict[str, Any]]) -> FollowGoal:
    participant: Any = SimpleNamespace()
    host = GoalHost(hub, participant, lambda _: answers.Done(), sent.append, lambda *_: None)
    args = msgspec.json.encode(trajectory((1.0, AWAY)))
    return FollowGoal(host, SendActionGoal(action=FOLLOW, args=msgspec.Raw(args), id="goal 1"))


def end(how: str, why: str = "") -> answers.MotionEnd:
    return answers.MotionEnd(how=how, why=why, q=[], T=None, gripper=0.0, seconds=1.0)


def test_result_says_which_time_was_not_kept(goal: FollowGoal, runner: RecordedRunner) -> None:
    runner.status = "done"
    result = goal._ended(end("reached"))
    assert result.status is GoalStatus.SUCCEEDED
    assert isinstance(result.values, dict)
    assert result.values["error_string"] == "Asked to take 0.01 s, it takes 1.56 s: why."


def test_contact_and_failure_are_a_violated_path(goal: FollowGoal, runner: RecordedRunner) -> None:
    for how, status in (("contact", "blocked"), ("failed", "failed"), ("timeout", "running")):
        runner.status = status
        with pytest.raises(GoalError) as failed:
            goal._ended(end(how))
        assert failed.value.code is ErrorCode.PATH_TOLERANCE_VIOLATED


def test_stop_and_pause_cancel_a_goal(goal: FollowGoal, runner: RecordedRunner) -> None:
    runner.status = "stopped"
    result = goal._ended(end("stopped", "Ada pressed STOP."))
    assert result.status is GoalStatus.CANCELED
    assert isinstance(result.values, dict)
    assert result.values["error_string"] == "Ada pressed STOP."
    runner.status = "paused"
    assert goal._ended(end("paused")).status is GoalStatus.CANCELED
    assert runner.ended == ["It was paused"]


def test_cancel_ends_the_program_once_with_its_reason(
    goal: FollowGoal, runner: RecordedRunner
) -> None:
    goal.cancel("The client cancelled it.")
    goal.cancel("The client called /hold.")
    assert runner.ended == ["The client cancelled it"]
    result = goal._ended(end("failed"))
    assert result.status is GoalStatus.CANCELED
    assert isinstance(result.values, dict)
    assert result.values["error_string"] == "The client cancelled it."


def test_goal_before_the_arm_is_ready_is_aborted_with_the_reason(runner: RecordedRunner) -> None:
    sent: list[dict[str, Any]] = []

    def present() -> None:
        raise LeaseError("The arm is not ready yet.")

    gate = SimpleNamespace(revocations=0, is_current=lambda _: True)
    hub: Any = SimpleNamespace(runner=runner, present=present, gate=gate)
    goal = made(hub, sent)
    participant: Any = goal.host.participant
    participant.actor = Actor(Person("a", "A client", Role.OPERATOR), CommandChannel.WEBSOCKET)
    asyncio.run(goal.run())
    assert goal.ended
    (result,) = sent
    assert result["status"] == GoalStatus.ABORTED
    assert result["values"]["error_string"] == "The arm is not ready yet."


def test_cancel_leaves_the_unread_program_of_another_client(
    goal: FollowGoal, runner: RecordedRunner
) -> None:
    runner.status, runner.owned = "planning", False
    goal.cancel("The client cancelled it.")
    assert runner.ended == []


def test_goal_that_is_not_sent_yet_ends_no_program_of_its_client(
    goal: FollowGoal, runner: RecordedRunner
) -> None:
    goal._is_sent, runner.status = False, "planning"
    goal.cancel("The client cancelled it.")
    assert runner.ended == []


def test_open_goal_of_a_client_that_answers_pings_is_no_heartbeat() -> None:
    t = 0.0
    heartbeat = LastHeartbeat(lambda: t)
    heartbeat.open, t = 1, 2.0
    assert heartbeat.newest == 2.0
    heartbeat.pinged = True
    assert heartbeat.newest == 0.0
