"""Goals of actions while they are followed, and those of the gripper: feedback, cancel, result."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from katana450.arm.control.state import Outcome
from katana450.errors import InputError, KatanaError
from katana450.extensions.rosbridge.messages import GripperCommand, GripperCommandResult, RosMessage
from katana450.extensions.rosbridge.ops import OpId, SendActionGoal, read
from katana450.server.api import answers, requests
from katana450.server.service import serialize
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant

FEEDBACK_INTERVAL = 0.1
"""[s] Interval of the feedback of a goal."""

REST_SECONDS = 5.0
"""[s] Maximum time for which a result waits until the arm is at rest."""


class GoalStatus(IntEnum):
    """Status of a result, of action_msgs/GoalStatus."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class Result(NamedTuple):
    """The end of a goal. ``values``: the result of the action, or the reason of a refusal."""

    status: GoalStatus
    values: RosMessage | str


@dataclass(frozen=True)
class GoalHost:
    """The connection of the client of a goal.

    Attributes:
        hub: the hub.
        participant: the client.
        ask: executes a request of the client. Raises KatanaError if it is refused.
        send: sends an operation.
        show: sends an operation in place of an earlier one that waits for a slow client.
    """

    hub: Hub
    participant: Participant
    ask: Callable[[requests.Request], answers.Answer]
    send: Callable[[dict[str, Any]], None]
    show: Callable[[str, dict[str, Any]], None]

    @property
    def arm(self) -> ArmHandle:
        """The arm. Raises LeaseError until it is ready."""
        return self.hub.present()

    def outcome(self, answer: answers.Answer) -> Future[Outcome] | None:
        """Return the outcome of the command with the ``answer``; None if it has none."""
        if not isinstance(answer, answers.Done) or answer.ticket is None:
            return None
        return self.arm.outcome(answer.ticket) if answer.outcome is None else None


class Goal(ABC):
    """One goal of an action, from its receipt to its result."""

    def __init__(self, host: GoalHost, op: SendActionGoal) -> None:
        self.host = host
        self.id: OpId = op.id
        self.action = op.action
        self._wanted = op.feedback
        self._shown = -math.inf
        self._ends: tuple[Result, float] | None = None
        self.ended = False

    @abstractmethod
    def start(self) -> Result | None:
        """Begin; return the result if there is one already. Raises KatanaError if refused."""

    @abstractmethod
    def follow(self) -> Result | None:
        """Continue; return the result at the end. Raises KatanaError if the goal fails."""

    @abstractmethod
    def end(self, why: str) -> Result:
        """Bring the arm to rest because of ``why``; return the result of a cancelled goal."""

    @abstractmethod
    def failure(self, error: KatanaError) -> Result:
        """Return the result of a goal that was refused or has failed."""

    @abstractmethod
    def feedback(self) -> RosMessage:
        """Return the present feedback."""

    @property
    def ends(self) -> bool:
        """True while the result only waits until the arm is at rest."""
        return self._ends is not None

    def begin(self) -> None:
        """Start, and send the result of a goal that ends at once."""
        self._advance(self.start)

    def tick(self) -> None:
        """Continue: send feedback, or the result once the arm is at rest."""
        t = self.host.hub.clock()
        if self._ends is not None:
            result, since = self._ends
            arm = self.host.hub.arm
            if arm is None or not arm.state.moving or t - since > REST_SECONDS:
                self._finish(result)
            return
        self._advance(self.follow)
        if not (self.ended or self.ends) and self._wanted and t - self._shown >= FEEDBACK_INTERVAL:
            self._shown = t
            op = {"op": "action_feedback", "action": self.action, "id": self.id}
            self.host.show(f"feedback {self.id}", {**op, "values": self.feedback()})

    def cancel(self, why: str) -> None:
        """Cancel the goal because of ``why``; the result is sent once the arm is at rest."""
        if not (self.ended or self.ends):
            self._ends = self.end(why), self.host.hub.clock()

    def _advance(self, step: Callable[[], Result | None]) -> None:
        try:
            result = step()
        except KatanaError as error:
            result = self.failure(error)
        if result is None:
            return
        if result.status is GoalStatus.ABORTED and not isinstance(result.values, str):
            # The motion of a goal that failed may still come to rest.
            self._ends = result, self.host.hub.clock()
        else:
            self._finish(result)

    def _finish(self, result: Result) -> None:
        self.ended = True
        self.host.send(
            {
                "op": "action_result",
                "action": self.action,
                "id": self.id,
                "values": result.values,
                "status": int(result.status),
                "result": not isinstance(result.values, str),
            }
        )


def refusal_of(done: answers.Answer, outcome: Future[Outcome] | None) -> str:
    """Return why the arm refuses the command with the answer ``done``; empty unless it does."""
    if outcome is None or not outcome.done() or not isinstance(done, answers.Done):
        return ""
    concluded = serialize.concluded(done, outcome.result())
    return concluded.why if isinstance(concluded, answers.Refused) else ""


REACHED = 2e-3
"""[rad or m] Distance from the goal at which it is reached."""

STALL_SECONDS = 0.4
"""[s] Time without motion after which the fingers count as stopped by an object."""

STILL = 1e-5
"""[rad or m] Motion of the fingers up to which they count as at rest."""


class GripperGoal(Goal):
    """One position of the fingers. It succeeds where they stop at an object, too: ``stalled``."""

    def __init__(self, host: GoalHost, op: SendActionGoal) -> None:
        """Create the goal. Raises InputError if it does not have the fields of its type."""
        super().__init__(host, op)
        self._command = read(op.args, GripperCommand, "a goal of GripperCommand").command
        self._revocations = 0
        self._answer: answers.Answer = answers.Done()
        self._outcome: Future[Outcome] | None = None
        self._place, self._since = math.inf, 0.0

    def start(self) -> Result | None:
        """Check the goal and give the command."""
        arm, command = self.host.arm, self._command
        gripper = arm.arm.gripper
        if not gripper.moves:
            raise InputError("This arm has no fingers that move.")
        if not gripper.lower <= command.position <= gripper.upper:
            raise InputError(
                f"The position {command.position:g} is not between {gripper.closed:g} (closed) and "
                f"{gripper.opened:g} (open)."
            )
        if command.max_effort:
            raise InputError("The effort of the fingers cannot be limited. Set max_effort to 0.")
        self._revocations = self.host.hub.gate.revocations
        self._answer = self.host.ask(
            requests.Gripper(angle=command.position, revocations=self._revocations)
        )
        self._outcome = self.host.outcome(self._answer)
        return None

    def follow(self) -> Result | None:
        """Check the fingers; see `Goal.follow`. Raises KatanaError if the command is refused."""
        if why := refusal_of(self._answer, self._outcome):
            raise InputError(why)
        hub, arm = self.host.hub, self.host.arm
        if hub.gate.revocations != self._revocations:
            return Result(GoalStatus.CANCELED, self._now())
        state, ticket = arm.state, getattr(self._answer, "ticket", None)
        if ticket is not None and arm.snapshot.ticket < ticket:
            return None
        # At an object the goal lies inside it, by the squeeze.
        goal = arm.arm.gripper.wider(state.gripper_goal, -state.squeeze)
        if abs(goal - self._command.position) > REACHED:
            return Result(GoalStatus.CANCELED, self._now())
        if abs(state.gripper - self._command.position) <= REACHED:
            return Result(GoalStatus.SUCCEEDED, self._now(reached=True))
        t = hub.clock()
        if abs(state.gripper - self._place) > STILL or state.paused:
            self._place, self._since = state.gripper, t
        if t - self._since > STALL_SECONDS:
            return Result(GoalStatus.SUCCEEDED, self._now(stalled=True))
        return None

    def end(self, why: str) -> Result:  # noqa: ARG002 - the result has no place for words
        """Stop the fingers where they are."""
        # Refused if the arm was stopped or another client drives: the fingers are not ours then.
        with suppress(KatanaError):
            self.host.ask(requests.Hold(revocations=self._revocations))
        return Result(GoalStatus.CANCELED, self._now())

    def failure(self, error: KatanaError) -> Result:
        """Return the reason: the result of this action has no place for it."""
        return Result(GoalStatus.ABORTED, str(error))

    def feedback(self) -> RosMessage:
        """Return where the fingers are."""
        return self._now()

    def _now(self, *, reached: bool = False, stalled: bool = False) -> GripperCommandResult:
        position = self.host.arm.state.gripper
        return GripperCommandResult(
            position=position, effort=0.0, stalled=stalled, reached_goal=reached
        )
