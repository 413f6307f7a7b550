"""A goal of FollowJointTrajectory: the script of its trajectory is planned, checked and run."""

from __future__ import annotations

import itertools
import re
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np

from katana450.arm.control.actor import Actor
from katana450.errors import KatanaError
from katana450.extensions.rosbridge.goals import Goal, GoalHost, GoalStatus, Result
from katana450.extensions.rosbridge.messages import (
    FollowedPoint,
    FollowJointTrajectory,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
    Header,
    RosMessage,
    time_of,
)
from katana450.extensions.rosbridge.ops import SendActionGoal, read
from katana450.extensions.rosbridge.trajectory import (
    START_TOLERANCE,
    CheckedTrajectory,
    ErrorCode,
    GoalError,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.server.service.runner import Runner

PLACE = re.compile(r"^line \d+, (column \d+|[^:]*): ", re.IGNORECASE)
"""Line and column with which a reason begins; removed, because the client has no script."""

_numbers = itertools.count(1)


class FollowGoal(Goal):
    """One trajectory. The program that moves along it drives, and this client owns it."""

    def __init__(self, host: GoalHost, op: SendActionGoal) -> None:
        """Create the goal. Raises InputError if it does not have the fields of its type."""
        super().__init__(host, op)
        self._goal = read(op.args, FollowJointTrajectory, "a goal of FollowJointTrajectory")
        self._name = f"ROS trajectory {next(_numbers)}"
        self._runs = False
        self._began = 0.0
        self._revocations = 0
        self._checked: CheckedTrajectory | None = None

    def start(self) -> Result | None:
        """Check the goal and begin to plan it."""
        hub, arm = self.host.hub, self.host.arm
        self._revocations = hub.gate.revocations
        hub.gate.check_not_stopped()
        if arm.state.moving:
            raise GoalError(
                ErrorCode.INVALID_GOAL, "The arm is moving. Send a trajectory when it is at rest."
            )
        chain = arm.arm.chain
        self._checked = checked = CheckedTrajectory.of(
            self._goal, chain.names, arm.state.setpoint, time.time()
        )
        if not checked.moves:
            return self._succeeded("The arm is there already.")
        script = checked.script(self._name)
        self.host.ask(Program(text=script, revocations=self._revocations))
        return None

    def follow(self) -> Result | None:
        """Continue with the progress of the program; see `Goal.follow`."""
        now = self._progress()
        if now is None:
            return self._canceled("Another program was sent.")
        match now.status:
            case "planning":
                # Raises if the arm was stopped, or the driver changed, while it was planned.
                self.host.hub.gate.check_current(self._actor)
            case "ready" if not self._runs:
                self._run(now)
            case "ready" if self._runner.runs_for(self.host.participant):
                # It was planned again because the scene has changed, and begins with the next tick.
                return None
            case "ready" | "cancelled":
                return self._canceled(now.why)
            case "refused":
                raise GoalError(ErrorCode.INVALID_GOAL, PLACE.sub("", now.why))
            case "failed":
                raise GoalError(ErrorCode.PATH_TOLERANCE_VIOLATED, PLACE.sub("", now.why))
            case "stopped":
                return self._canceled(now.why)
            case "done":
                self._trajectory.check_end(self.host.arm.state.q, self._joints)
                return self._succeeded(PLACE.sub("", now.why))
        if self._runs:
            self._check_path()
        return None

    def end(self, why: str) -> Result:
        """End the program, which brakes the arm."""
        self._end_program(why)
        return self._canceled(why)

    def failure(self, error: KatanaError) -> Result:
        """Return the result with the error code, after ending the program."""
        self._end_program(str(error))
        if isinstance(error, GoalError):
            return _result(GoalStatus.ABORTED, error.code, str(error))
        if self._checked is not None and not self.host.hub.gate.is_current(self._actor):
            return self._canceled(str(error))
        return _result(GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, str(error))

    def feedback(self) -> RosMessage:
        """Return the actual and the desired posture."""
        state = self.host.arm.state
        passed = time_of(self.host.hub.clock() - self._began if self._runs else 0.0)

        def point(q: FloatArray, qd: FloatArray) -> FollowedPoint:
            return FollowedPoint(
                positions=q.tolist(), velocities=qd.tolist(), time_from_start=passed
            )

        rates, none = state.motion.qd, np.zeros(len(state.q))
        return FollowJointTrajectoryFeedback(
            header=Header(stamp=time_of(time.time())),
            joint_names=list(self._joints),
            desired=point(state.setpoint, rates),
            actual=point(state.q, rates),
            error=point(state.setpoint - state.q, none),
        )

    @property
    def _actor(self) -> Actor:
        """The client as it was when the goal was received."""
        return replace(self.host.participant.actor, seen=self._revocations)

    @property
    def _trajectory(self) -> CheckedTrajectory:
        assert self._checked is not None
        return self._checked

    @property
    def _joints(self) -> tuple[str, ...]:
        return self.host.arm.arm.chain.names

    def _run(self, now: answers.Progress) -> None:
        """Run the planned program. Raises GoalError if the arm has left the start meanwhile."""
        state = self.host.arm.state
        if float(np.abs(state.setpoint - self._trajectory.postures[0]).max()) > START_TOLERANCE:
            raise GoalError(
                ErrorCode.INVALID_GOAL, "The arm was moved while the trajectory was planned."
            )
        self._trajectory.check_time(now.seconds / state.speed)
        self.host.ask(Steer(order=ProgramOrder.RUN, revocations=self._revocations))
        self._runs, self._began = True, self.host.hub.clock()

    def _check_path(self) -> None:
        """Raise GoalError if the arm is too far from where it should be now."""
        state = self.host.arm.state
        self._trajectory.check_path(state.setpoint - state.q, self._joints)

    def _progress(self) -> answers.Progress | None:
        """Return the progress of the program; None if it is not the present one any more."""
        now = self._runner.progress()
        if now is None:
            return None
        # A script has no name until its thread has read it.
        unread = not now.name and self._runner.owns(self.host.participant)
        return now if now.name == self._name or unread else None

    @property
    def _runner(self) -> Runner:
        return self.host.hub.runner

    def _end_program(self, why: str) -> None:
        """End the program, its planning, or the run that waits for the planning, because of why."""
        now = self._progress()
        if now is not None and now.status in ("planning", "running", "paused", "blocked"):
            with suppress(KatanaError):
                self.host.ask(Steer(order=ProgramOrder.END))
        if now is not None:
            self._runner.end(self.host.participant, why.rstrip("."))

    def _succeeded(self, why: str) -> Result:
        return _result(GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, why)

    def _canceled(self, why: str) -> Result:
        # ROS has no code for a cancelled goal; its status says so.
        return _result(GoalStatus.CANCELED, ErrorCode.SUCCESSFUL, why)


def _result(status: GoalStatus, code: ErrorCode, why: str) -> Result:
    return Result(status, FollowJointTrajectoryResult(error_code=int(code), error_string=why))
