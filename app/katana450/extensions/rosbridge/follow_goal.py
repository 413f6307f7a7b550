"""A goal of FollowJointTrajectory: its checks, and the script that is planned and run for it.

The script has one step `trajectory`: a natural cubic spline through the positions, checked as a
whole for limits and contacts before anything moves, at the given times or slower ones where the
limits require it.
"""

from __future__ import annotations

import asyncio
import itertools
import math
import re
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from katana450.arm.control.actor import Actor
from katana450.arm.control.commands.act import MAX_WAIT
from katana450.errors import InputError, KatanaError
from katana450.extensions.programs.planning.trajectory_path import MIN_INTERVAL
from katana450.extensions.rosbridge.goals import Goal, GoalHost, GoalStatus, Result
from katana450.extensions.rosbridge.messages import (
    Fields,
    FollowJointTrajectory,
    Header,
    JointTrajectoryPoint,
    time_of,
)
from katana450.extensions.rosbridge.ops import SendActionGoal, read
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.server.service.hub import TICK
from katana450.server.service.pending_answer import CONTACT, PAUSED, REACHED, TIMEOUT

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
        _check_stamp(trajectory.header.stamp.seconds, times[-1], now)
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


def _check_stamp(stamp: float, duration: float, now: float) -> None:
    """Raise GoalError for a start time other than 0 or about ``now``."""
    if not stamp or abs(stamp - now) <= CLOCK_TOLERANCE:
        return
    if stamp > now:
        raise _invalid(
            f"The trajectory would begin in {stamp - now:.1f} s. Send it when it is to begin, with "
            "a stamp of 0."
        )
    ended = " and has ended" if stamp + duration < now else ""
    raise GoalError(
        ErrorCode.OLD_HEADER_TIMESTAMP,
        f"The trajectory began {now - stamp:.1f} s ago{ended}. Send it with a stamp of 0.",
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
