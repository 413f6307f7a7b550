"""Goals of actions while they are followed: feedback, cancel, and the result."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from katana450.arm.control.state import Outcome
from katana450.errors import KatanaError
from katana450.extensions.rosbridge.messages import RosMessage
from katana450.extensions.rosbridge.ops import OpId, SendActionGoal
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
