"""Goals of actions while they are followed, and those of the gripper: feedback, cancel, result."""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from katana450.errors import InputError, KatanaError
from katana450.extensions.rosbridge.messages import Fields, GripperCommand
from katana450.extensions.rosbridge.ops import OpId, SendActionGoal, read
from katana450.server.api import answers, requests
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.pending_answer import ARRIVED, CONTACT, PendingAnswer

log = logging.getLogger(__name__)

FEEDBACK_INTERVAL = 0.1
"""[s] Interval of the feedback of a goal."""

ERROR_TEXT = "The server had an internal error; see its log."


class GoalStatus(IntEnum):
    """Status of a result, of action_msgs/GoalStatus."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class Result(NamedTuple):
    """The end of a goal. ``values``: the result of the action, or the reason of a refusal."""

    status: GoalStatus
    values: Fields | str


@dataclass(frozen=True)
class GoalHost:
    """The connection of the client of a goal.

    Attributes:
        hub: the hub.
        participant: the client.
        handle: executes a request of the client. Raises KatanaError if it is refused.
        send: sends an operation.
        show: sends an operation in place of an earlier one that waits for a slow client.
    """

    hub: Hub
    participant: Participant
    handle: Callable[[requests.Request], answers.Answer | PendingAnswer]
    send: Callable[[dict[str, Any]], None]
    show: Callable[[str, dict[str, Any]], None]

    @property
    def arm(self) -> ArmHandle:
        """The arm. Raises LeaseError until it is ready."""
        return self.hub.present()

    async def motion_end(self, request: requests.MotionRequest) -> answers.MotionEnd:
        """Execute ``request`` and return how its motion has ended. Raises KatanaError if refused.

        The arm is at rest then, unless something else moves it.
        """
        answer = self.handle(request)
        if isinstance(answer, PendingAnswer):
            answer = await answer.answer()
        if isinstance(answer, answers.Refused):
            raise InputError(answer.why)
        assert isinstance(answer, answers.Done)
        assert answer.end is not None
        return answer.end


class Goal(ABC):
    """One goal of an action, from its receipt to its result."""

    def __init__(self, host: GoalHost, op: SendActionGoal) -> None:
        self.host = host
        self.id: OpId = op.id
        self.action = op.action
        self._wanted = op.feedback
        self._shown = -math.inf
        self.cancelled = ""
        """Why the goal was cancelled; empty unless it was."""
        self.ended = False

    @abstractmethod
    async def result(self) -> Result:
        """Execute the goal. Raises KatanaError if it is refused or fails."""

    @abstractmethod
    def end(self, why: str) -> None:
        """Bring the arm to rest because of ``why``."""

    @abstractmethod
    def failure(self, error: KatanaError) -> Result:
        """Return the result of a goal that was refused or has failed."""

    @abstractmethod
    def feedback(self) -> Fields:
        """Return the present feedback."""

    async def run(self) -> None:
        """Execute the goal, and send its result."""
        try:
            result = await self.result()
        except KatanaError as error:
            result = self.failure(error)
        except Exception:
            log.exception("Error in a goal.")
            self.end(ERROR_TEXT)
            result = self.failure(InputError(ERROR_TEXT))
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

    def tick(self) -> None:
        """Send feedback if it is due."""
        t = self.host.hub.clock()
        if self._wanted and not self.ended and t - self._shown >= FEEDBACK_INTERVAL:
            self._shown = t
            op = {"op": "action_feedback", "action": self.action, "id": self.id}
            self.host.show(f"feedback {self.id}", {**op, "values": self.feedback()})

    def cancel(self, why: str) -> None:
        """Cancel the goal because of ``why``; the result is sent once the arm is at rest."""
        if not (self.ended or self.cancelled):
            self.cancelled = why
            self.end(why)


REACHED = 2e-3
"""[rad or m] Distance from the goal at which it is reached."""

FINGER_SECONDS = 60.0
"""[s] Maximum duration of a motion of the fingers."""


class GripperGoal(Goal):
    """One position of the fingers. It succeeds where they stop at an object, too: ``stalled``."""

    def __init__(self, host: GoalHost, op: SendActionGoal) -> None:
        """Create the goal. Raises InputError if it does not have the fields of its type."""
        super().__init__(host, op)
        self._command = read(op.args, GripperCommand, "a goal of GripperCommand").command
        self._revocations = host.hub.gate.revocations

    async def result(self) -> Result:
        """Check the goal, give the command, and wait until the fingers are at rest."""
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
        request = requests.Gripper(
            angle=command.position, revocations=self._revocations, wait=FINGER_SECONDS
        )
        end = await self.host.motion_end(request)
        if self.cancelled or end.how not in (*ARRIVED, CONTACT):
            return Result(GoalStatus.CANCELED, self.feedback())
        reached = abs(arm.state.gripper - command.position) <= REACHED
        ends = {"stalled": not reached, "reached_goal": reached}
        return Result(GoalStatus.SUCCEEDED, self.feedback() | ends)

    def end(self, why: str) -> None:  # noqa: ARG002 - the result has no place for words
        """Stop the fingers where they are."""
        # Refused if the arm was stopped or another client drives: the fingers are not ours then.
        with suppress(KatanaError):
            self.host.handle(requests.Hold(revocations=self._revocations))

    def failure(self, error: KatanaError) -> Result:
        """Return the reason: the result of this action has no place for it."""
        return Result(GoalStatus.ABORTED, str(error))

    def feedback(self) -> Fields:
        """Return where the fingers are; they have not come to rest yet."""
        position = self.host.arm.state.gripper
        return {"position": position, "effort": 0.0, "stalled": False, "reached_goal": False}
