"""A goal of GripperCommand: the fingers move to a position, or stop at an object before it."""

from __future__ import annotations

import math
from concurrent.futures import Future
from contextlib import suppress

from katana450.arm.control.state import Outcome
from katana450.errors import InputError, KatanaError
from katana450.extensions.rosbridge.goals import Goal, GoalHost, GoalStatus, Result, refusal_of
from katana450.extensions.rosbridge.messages import GripperCommand, GripperCommandResult, RosMessage
from katana450.extensions.rosbridge.ops import SendActionGoal, read
from katana450.server.api import answers, requests

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
        arm, given = self.host.arm, self._command
        gripper = arm.arm.gripper
        if not gripper.moves:
            raise InputError("This arm has no fingers that move.")
        if not gripper.lower <= given.position <= gripper.upper:
            raise InputError(
                f"The position {given.position:g} is not between {gripper.closed:g} (closed) and "
                f"{gripper.opened:g} (open)."
            )
        if given.max_effort:
            raise InputError("The effort of the fingers cannot be limited. Set max_effort to 0.")
        self._revocations = self.host.hub.gate.revocations
        self._answer = self.host.ask(
            requests.Gripper(angle=given.position, revocations=self._revocations)
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
