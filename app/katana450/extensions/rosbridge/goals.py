"""Goals of actions while they are followed: feedback, cancel, result.

A goal of FollowJointTrajectory becomes a script with one step `trajectory`: a natural cubic spline
through the positions, checked as a whole for limits and contacts before anything moves, at the
given times or slower ones where the limits require it.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from katana450.arm.control.commands.act import MAX_WAIT
from katana450.arm.control.lease import Actor
from katana450.errors import InputError, KatanaError
from katana450.extensions.programs.steps.trajectory import MIN_INTERVAL
from katana450.extensions.rosbridge.protocol import (
    Fields,
    FollowJointTrajectory,
    GripperCommand,
    Header,
    JointTrajectoryPoint,
    OpId,
    SendActionGoal,
    read,
    time_of,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.participants import Participant
from katana450.server.service.pending_answer import (
    ARRIVED,
    CONTACT,
    PAUSED,
    REACHED,
    TIMEOUT,
    PendingAnswer,
)

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


FINGER_TOLERANCE = 2e-3
"""[rad or m] Distance from the goal at which the fingers have reached it."""

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
        reached = abs(arm.state.gripper - command.position) <= FINGER_TOLERANCE
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


MAX_POINTS = 700
"""Maximum number of points, which fit in a script of 64 KB."""

MAX_SECONDS = MAX_WAIT
"""[s] Maximum duration."""

START_TOLERANCE = 0.02
"""[rad] Distance of a first point at time 0 from the posture of the arm."""

CLOCK_TOLERANCE = 1.0
"""[s] Maximum difference between a start time and now that counts as clock difference."""

STANDS = 1e-6
"""[rad] Motion of a joint up to which it counts as at rest."""

MAX_END_RATE = 1e-3
"""[rad/s] Rate of a joint at the end that counts as rest."""


class ErrorCode(IntEnum):
    """Error codes of control_msgs/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalError(InputError):
    """Raised for a goal that is refused or fails.

    Attributes:
        code: Error code of the result.
    """

    def __init__(self, code: ErrorCode, why: str) -> None:
        super().__init__(why)
        self.code = code


@dataclass(frozen=True, eq=False)
class CheckedTrajectory:
    """A goal whose form is valid.

    Attributes:
        times: (m,) [s], the first one 0.
        postures: (m, n) [rad], in the order of the arm's joints; the first is that of the arm.
        time_tolerance: maximum delay of the end [s]; infinite without one.
    """

    times: FloatArray
    postures: FloatArray
    time_tolerance: float

    @classmethod
    def of(
        cls,
        goal: FollowJointTrajectory,
        joints: Sequence[str],
        q: FloatArray,
        now: float,
        *,
        anywhere: bool = False,
    ) -> CheckedTrajectory:
        """Return ``goal`` for an arm with ``joints`` at rest at ``q`` (n,) [rad].

        ``now`` is the time [s since the epoch]. ``anywhere``: a first point at time 0 may be away
        from ``q``. Raises GoalError with the reason for a refusal.
        """
        trajectory = goal.trajectory
        if sorted(trajectory.joint_names) != sorted(joints):
            raise GoalError(
                ErrorCode.INVALID_JOINTS,
                f"The joints of the goal are {', '.join(trajectory.joint_names) or 'none'}; they "
                f"must be {', '.join(joints)}, in any order.",
            )
        if not 0 < len(trajectory.points) <= MAX_POINTS:
            raise _invalid(
                f"The trajectory has {len(trajectory.points)} points; it must have 1 to "
                f"{MAX_POINTS}."
            )
        order = [trajectory.joint_names.index(name) for name in joints]
        rows = [
            _positions(point, number, order) for number, point in enumerate(trajectory.points, 1)
        ]
        times = [point.time_from_start.seconds for point in trajectory.points]
        for number, (before, after) in enumerate(zip((0.0, *times), times, strict=False), 1):
            least = 0.0 if number == 1 else MIN_INTERVAL
            if not after - before >= least - 1e-9:
                raise _invalid(
                    f"Point {number} has the time {after:g} s; it must be at least "
                    f"{1e3 * MIN_INTERVAL:g} ms later than the point before."
                )
        if times[-1] > MAX_SECONDS:
            raise _invalid(f"A trajectory lasts at most {MAX_SECONDS:g} s.")
        _check_end(trajectory.points[-1])
        _check_stamp(trajectory.header.stamp.seconds, now)
        postures = np.array(rows)
        if times[0] < MIN_INTERVAL:
            away = float(np.abs(postures[0] - q).max())
            if away > START_TOLERANCE and not anywhere:
                raise _invalid(
                    f"The first point is at time 0 and {away:.3g} rad from where the arm stands. "
                    "Begin where it stands, or give the first point a later time."
                )
            times, postures = times[1:], postures[1:]
        return cls(
            np.array([0.0, *times]),
            np.vstack((q, *postures)),
            goal.goal_time_tolerance.seconds or math.inf,
        )

    @property
    def duration(self) -> float:
        """The time from the start to the last point [s]."""
        return float(self.times[-1])

    @property
    def moves(self) -> bool:
        """True if any joint moves."""
        return float(np.ptp(self.postures, axis=0).max()) > STANDS

    def script(self, name: str) -> str:
        """Return the script of one step that moves along the trajectory."""
        rows = (
            ", ".join([f"{time:.4f}", *(f"{angle:.6f}" for angle in angles)])
            for time, angles in zip(
                self.times.tolist(), np.degrees(self.postures).tolist(), strict=True
            )
        )
        lines = "".join(f"    - [{row}]\n" for row in rows)
        return f"name: {name}\nsteps:\n- trajectory:\n    through:\n{lines}"

    def check_time(self, seconds: float) -> None:
        """Raise GoalError if the planned duration ``seconds`` [s] exceeds the tolerance."""
        if seconds > self.duration + self.time_tolerance:
            raise GoalError(
                ErrorCode.GOAL_TOLERANCE_VIOLATED,
                f"Within its limits the arm needs {seconds:.2f} s for a trajectory of "
                f"{self.duration:.2f} s, and goal_time_tolerance is {self.time_tolerance:g} s. "
                "Nothing has moved.",
            )


def _invalid(why: str) -> GoalError:
    return GoalError(ErrorCode.INVALID_GOAL, why)


def _positions(point: JointTrajectoryPoint, number: int, order: Sequence[int]) -> list[float]:
    """Return the positions of ``point`` in the order of the arm's joints."""
    n = len(order)
    for name, values in (
        ("positions", point.positions),
        ("velocities", point.velocities),
        ("accelerations", point.accelerations),
    ):
        if len(values) != n and (values or name == "positions"):
            raise _invalid(f"Point {number} has {len(values)} {name}; it must have {n}.")
        if not all(map(math.isfinite, values)):
            raise _invalid(f"Point {number} has {name} that are not finite.")
    if point.effort:
        raise _invalid(f"Point {number} has efforts, which the arm does not have. Leave them out.")
    return [point.positions[k] for k in order]


def _check_end(last: JointTrajectoryPoint) -> None:
    if any(abs(rate) > MAX_END_RATE for rate in last.velocities):
        raise _invalid(
            "The velocities of the last point are not 0: the arm would not come to rest."
        )


def _check_stamp(stamp: float, now: float) -> None:
    """Raise GoalError for a start time other than 0 or about ``now``."""
    if stamp and abs(stamp - now) > CLOCK_TOLERANCE:
        raise GoalError(
            ErrorCode.OLD_HEADER_TIMESTAMP if stamp < now else ErrorCode.INVALID_GOAL,
            f"The stamp is {stamp - now:+.1f} s from now. Send a trajectory when it is to begin, "
            "with a stamp of 0.",
        )


PLACE = re.compile(r"^line \d+, (column \d+|[^:]*): ", re.IGNORECASE)
"""Line and column with which a reason begins; removed, because the client has no script."""

_numbers = itertools.count(1)


class FollowGoal(Goal):
    """One trajectory. The program that moves along it drives, and this client owns it.

    A valid goal replaces the ``earlier`` ones of its client, as in ros2_control: they brake the
    arm, and it begins where the arm comes to rest.
    """

    def __init__(
        self, host: GoalHost, op: SendActionGoal, earlier: Sequence[FollowGoal] = ()
    ) -> None:
        """Create the goal. Raises InputError if it does not have the fields of its type."""
        super().__init__(host, op)
        self._earlier = earlier
        self._received = time.time()
        self._is_sent = False
        self._goal = read(op.args, FollowJointTrajectory, "a goal of FollowJointTrajectory")
        self._name = f"ROS trajectory {next(_numbers)}"
        self._began: float | None = None
        self._revocations = host.hub.gate.revocations

    async def result(self) -> Result:
        """Check the trajectory, plan it and move along it."""
        gate, arm = self.host.hub.gate, self.host.arm
        gate.check_not_stopped()
        self._checked()
        if self._earlier:
            await self._replace()
        if self.cancelled:
            return self._canceled("")
        if arm.state.moving:
            raise _invalid("The arm is moving. Send a trajectory when it is at rest.")
        trajectory = self._checked()
        if not trajectory.moves:
            return _result(GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, "The arm is there already.")
        script = trajectory.script(self._name)
        self.host.handle(Program(text=script, revocations=self._revocations))
        self._is_sent = True
        while (now := self._progress()) is not None and now.status == "planning":
            # Raises if the arm was stopped, or the driver changed, while it was planned.
            gate.check_current(self._actor)
            await asyncio.sleep(TICK)
        if now is None:
            return self._canceled("Another program was sent.")
        if now.status == "refused":
            raise _invalid(PLACE.sub("", now.why))
        if now.status != "ready":
            return self._canceled(now.why)
        state = arm.state
        if float(np.abs(state.setpoint - trajectory.postures[0]).max()) > START_TOLERANCE:
            raise _invalid("The arm was moved while the trajectory was planned.")
        trajectory.check_time(now.seconds / state.speed)
        self._began = self.host.hub.clock()
        request = Steer(order=ProgramOrder.RUN, revocations=self._revocations, wait=MAX_SECONDS)
        end = await self.host.motion_end(request)
        return self._ended(end)

    async def _replace(self) -> None:
        """Cancel the earlier goals, and wait until the arm is at rest. Raises LeaseError."""
        gate = self.host.hub.gate
        for goal in self._earlier:
            goal.cancel("A newer trajectory replaces it.")
        # Their program has released the lease, which voids no goal of its owner; a stop does, and
        # could not be cleared yet.
        self._revocations = gate.revocations
        gate.check_not_stopped()
        while not all(goal.ended for goal in self._earlier):
            gate.check_current(self._actor)
            await asyncio.sleep(TICK)

    def _checked(self) -> CheckedTrajectory:
        """Return the trajectory from where the arm is. Raises GoalError if it is invalid."""
        arm = self.host.arm
        names, q = arm.arm.chain.names, arm.state.setpoint
        return CheckedTrajectory.of(
            self._goal, names, q, self._received, anywhere=bool(self._earlier)
        )

    def _ended(self, end: answers.MotionEnd) -> Result:
        """Return the result of a trajectory that was begun. Raises GoalError if it failed."""
        now = self._progress()
        why, status = ("", "") if now is None else (PLACE.sub("", now.why), now.status)
        if end.how == REACHED:
            return _result(GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, why)
        if end.how in (CONTACT, TIMEOUT) or status == "failed":
            raise GoalError(ErrorCode.PATH_TOLERANCE_VIOLATED, why or end.why)
        if end.how == PAUSED:
            self.end("It was paused.")
        return self._canceled(end.why or why)

    def end(self, why: str) -> None:
        """End the program, its planning, or the run that waits for the planning, because of why."""
        now, runner = self._progress(), self.host.hub.runner
        if now is not None and now.status in ("planning", "running", "paused", "blocked"):
            with suppress(KatanaError):
                self.host.handle(Steer(order=ProgramOrder.END))
        if now is not None:
            runner.end(self.host.participant, why.rstrip("."))

    def failure(self, error: KatanaError) -> Result:
        """Return the result with the error code, after ending the program."""
        self.end(str(error))
        if isinstance(error, GoalError):
            return _result(GoalStatus.ABORTED, error.code, str(error))
        if not self.host.hub.gate.is_current(self._actor):
            return self._canceled(str(error))
        return _result(GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, str(error))

    def feedback(self) -> Fields:
        """Return the actual and the desired posture."""
        state = self.host.arm.state
        t = self.host.hub.clock()
        passed = time_of(0.0 if self._began is None else t - self._began)

        def point(q: FloatArray, qd: FloatArray) -> JointTrajectoryPoint:
            return JointTrajectoryPoint(
                positions=q.tolist(), velocities=qd.tolist(), time_from_start=passed
            )

        rates, none = state.motion.qd, np.zeros(len(state.q))
        return {
            "header": Header(stamp=time_of(time.time())),
            "joint_names": list(self.host.arm.arm.chain.names),
            "desired": point(state.setpoint, rates),
            "actual": point(state.q, rates),
            "error": point(state.setpoint - state.q, none),
        }

    @property
    def _actor(self) -> Actor:
        """The client as it was when the goal was received."""
        return replace(self.host.participant.actor, seen=self._revocations)

    def _progress(self) -> answers.Progress | None:
        """Return the progress of the program; None if it is not the present one any more."""
        runner = self.host.hub.runner
        now = runner.progress()
        if now is None or not self._is_sent:
            return None
        # A script has no name until its thread has read it.
        unread = not now.name and runner.owns(self.host.participant)
        return now if now.name == self._name or unread else None

    def _canceled(self, why: str) -> Result:
        # ROS has no code for a cancelled goal; its status says so.
        return _result(GoalStatus.CANCELED, ErrorCode.SUCCESSFUL, self.cancelled or why)


def _result(status: GoalStatus, code: ErrorCode, why: str) -> Result:
    return Result(status, {"error_code": int(code), "error_string": why})
