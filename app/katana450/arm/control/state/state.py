"""The whole state of the session: one immutable value per tick."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from katana450.arm.control.state.arm_report import ArmMode, ArmReport
from katana450.arm.control.state.modes import (
    IDLE,
    Following,
    Idle,
    Jogging,
    JointTarget,
    Leaving,
    Mode,
    Positioning,
    Servoing,
    Target,
    Tracking,
)
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.stop_cause import WATCHDOG, StopCause
from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.motion.stream import Stream
from katana450.maths.physics.model import BodyMotion
from katana450.maths.water.flow import MotionWithWater


class Status(Enum):
    """Relation of the goal of the arm to its target."""

    OK = "ok"
    LIMITED = "limited"
    PAUSED = "paused"
    BLOCKED = "blocked"
    GAP = "gap"
    STOPPED = "stopped"
    FAULT = "fault"


class Reason(Enum):
    """Reason why the goal differs from the target, or is not approached."""

    STOPPED = "stopped"
    PAUSED = "paused"
    CONTACT = "contact"
    ACROSS_GAP = "across a gap"
    OUT_OF_REACH = "out of reach"
    POSITION_CHANGED = "position changed"
    AXIS_1 = "axis 1 in the way"
    LINKS = "links reach no farther"
    SINGULAR = "singular"
    ELBOW_END = "elbow at its end"
    AXIS_LIMIT = "axis limit"
    SLIDE_LIMIT = "slide limit"
    GRIPPER_LIMIT = "gripper limit"
    GRIPPER_SLIDE_LIMIT = "gripper slide limit"
    YAW_FIXED = "yaw fixed"
    PITCH_CHANGED = "pitch changed"
    ROLL_CHANGED = "roll changed"
    ORIENTATION_CHANGED = "orientation changed"
    NOT_AT_START = "not at the start"
    LOPSIDED = "one finger only"
    LEAKING = "leaking"
    SLIDING = "sliding"
    SLIPPED = "slipped"
    CRUSHED = "crushed"
    SLOW_ZONE = "zone of reduced speed"
    INTERNAL = "internal error"
    RESTARTED = "restarted"
    WAITING = "waiting"
    DRIVER_SILENT = "driver silent"
    DRIVER_LEFT = "driver left"
    SERVER_SILENT = "server silent"
    LOOP_LATE = "loop late"
    MACHINE_BUSY = "machine busy"
    NOT_FOLLOWING = "arm does not follow"
    ARM_SILENT = "arm silent"
    TRACKING_ERROR = "tracking error"
    MEASURED_CONTACT = "measured contact"
    MEASURED_STOP = "measured stop"


CAUSES = (
    Reason.RESTARTED,
    Reason.DRIVER_SILENT,
    Reason.DRIVER_LEFT,
    Reason.SERVER_SILENT,
    Reason.LOOP_LATE,
    Reason.MACHINE_BUSY,
    Reason.NOT_FOLLOWING,
    Reason.ARM_SILENT,
    Reason.TRACKING_ERROR,
    Reason.MEASURED_CONTACT,
    Reason.MEASURED_STOP,
)
"""The reasons for which the server itself stops or pauses the arm."""

GRIPPER_REASONS = (
    *(Reason.GRIPPER_LIMIT, Reason.GRIPPER_SLIDE_LIMIT, Reason.SLIPPED, Reason.CRUSHED),
)
"""The reasons that concern only the fingers, until their next command."""


@dataclass(frozen=True)
class Finding:
    """One reason with its numbers.

    Attributes:
        reason: the reason.
        amount: the size of the effect [m or rad]. For a limit, the limit itself [rad or m]; for a
            gap, the leap across it [rad]; for a contact, the remaining distance [m]; for a
            stop, the travel of the tool, or else of any link, until rest [m]; for a plan, the
            distance of the arm from its start [rad]; for silence and lateness, the time [s]; for a
            tracking error and a measured stop, the angle of a joint [rad]; for an object that
            slides or has slipped, its load [N]; for one that was crushed, the force [N]; for a
            suction cup that leaks, its gap [m]; for a zone, the maximum speed of the tool [m/s].
        axis: the axis that the finding concerns, counted from 0; None if it concerns no axis.
        parts: the two links or objects that the finding concerns; None if it concerns none.
        time: for a stop, the time until rest [s].
        limit: for an object that was crushed, the force that it bears, and for one that slides on
            a suction cup or has slipped off it, that of the cup [N].
    """

    reason: Reason
    amount: float = 0.0
    axis: int | None = None
    parts: tuple[str, str] | None = None
    time: float = 0.0
    limit: float = 0.0


class Verdict(Enum):
    """Extent to which a command takes effect."""

    ACCEPTED = "accepted"
    """The command takes effect as given."""
    LIMITED = "limited"
    """The command takes effect as far as the arm can; the findings name the limits."""
    REFUSED = "refused"
    """The command takes no effect: nothing has changed."""


@dataclass(frozen=True)
class PartRefusal:
    """A refused part of a batch.

    Attributes:
        part: its index in the batch, from 0.
        command: name of its class.
        why: the reason in words.
    """

    part: int
    command: str
    why: str


@dataclass(frozen=True)
class Outcome:
    """The outcome of one command.

    Attributes:
        verdict: the extent to which it takes effect.
        findings: the reasons that limit it.
        why: the reason in words, if the verdict is REFUSED without a finding.
        refused: the parts of a batch that take no effect.
    """

    verdict: Verdict = Verdict.ACCEPTED
    findings: tuple[Finding, ...] = ()
    why: str = ""
    refused: tuple[PartRefusal, ...] = ()


ACCEPTED = Outcome()


@dataclass(frozen=True)
class ActiveStop:
    """The stop that holds the arm until it is cleared.

    Attributes:
        way, time: distance [m] and time [s] until rest. The distance is that of the tool, or else
            of any link.
        cause: cause of the first STOP.
        newest: time of the newest STOP [s], on the clock of ``State.t``.
    """

    way: float
    time: float
    cause: StopCause = WATCHDOG
    newest: float = -math.inf


@dataclass(frozen=True, eq=False)
class State:
    """The complete state of the session after a tick.

    Attributes:
        t: time of the tick [s].
        q, gripper: the place of the arm that the driver reported last, (n,) and scalar [rad].
        motion, gripper_setpoint: the setpoint for the driver in this tick, and its motion.
        goal, gripper_goal: the nearest posture to the target, to which the arm moves.
        tool: the tool frame that targets and read-outs refer to. It is empty for a robot that has
            only joints; ``branch`` and ``priority`` have no meaning then.
        branch: the branch that dragging keeps.
        priority: which part of a target is kept when the arm cannot satisfy all of it.
        findings: why the goal is not the target, or is not approached; else empty.
        blocked: whether the arm waits on its path because it would touch something.
        stopped: the stop that holds the arm until it is cleared; None if there is none.
        presses: names of the newest presses of STOP, also of stops that were cleared since.
        paused: whether the arm waits on its path during a pause.
        speed: the fraction of every maximum speed that is allowed, above 0 and up to 1.
        mode: the cause that decides where the goal is. A drag ends when the goal has reached its
            target; until then the findings are those from before.
        objects: the objects that stand around or are held.
        grip: the angle of the finger joint at which an object is held [rad]; None with an empty
            hand.
        squeeze: the angle by which the commanded finger joint lies beyond ``grip``, not negative
            [rad or m]; 0 with an empty hand.
        poured: the water of the cup; None if there is none.
        bodies: the motion of the loose objects, with the forces of the fingers; None while all of
            them are at rest and the fingers touch none.
        report: the report of the driver; None for an arm that follows its setpoints exactly.
        astray_since: time since which the tracking error is too large [s]; None if it is not.
        outcomes: the outcomes of the commands of this tick, one for each.
    """

    t: float
    q: FloatArray
    gripper: float
    motion: JointMotion
    gripper_setpoint: float
    goal: FloatArray
    gripper_goal: float
    tool: str
    branch: AnyBranch
    priority: Priority = Priority.POSE
    findings: tuple[Finding, ...] = ()
    blocked: bool = False
    stopped: ActiveStop | None = None
    presses: tuple[str, ...] = ()
    paused: bool = False
    speed: float = 1.0
    mode: Mode = IDLE
    objects: tuple[SceneObject, ...] = ()
    grip: float | None = None
    squeeze: float = 0.0
    poured: MotionWithWater | None = None
    bodies: BodyMotion | None = None
    report: ArmReport | None = None
    astray_since: float | None = None
    outcomes: tuple[Outcome, ...] = ()

    @property
    def status(self) -> Status:
        """The status that follows from the findings, the stop and the pause."""
        if any(finding.reason is Reason.INTERNAL for finding in self.findings):
            return Status.FAULT
        if self.stopped is not None:
            return Status.STOPPED
        if self.paused or self.waits:
            return Status.PAUSED
        if any(finding.reason is Reason.CONTACT for finding in self.findings):
            return Status.BLOCKED
        if any(finding.reason is Reason.ACROSS_GAP for finding in self.findings):
            return Status.GAP
        limited = any(finding.reason is not Reason.SLOW_ZONE for finding in self.findings)
        return Status.LIMITED if limited else Status.OK

    @property
    def waits(self) -> bool:
        """True if the server has paused the arm, which waits for a new command."""
        return any(finding.reason is Reason.WAITING for finding in self.findings)

    @property
    def pause_cause(self) -> Finding | None:
        """Cause of a pause by the server from which a program may resume; None without one."""
        is_paused = self.paused and not self.waits
        return next(
            (finding for finding in self.findings if is_paused and finding.reason in CAUSES), None
        )

    @property
    def intent(self) -> Idle | Positioning | Tracking | Jogging | Servoing | Following:
        """The mode, or the mode that has superseded the plan which the arm is leaving."""
        return self.mode.then if isinstance(self.mode, Leaving) else self.mode

    @property
    def target(self) -> Target:
        """The target as it was given, or the goal in a mode without a target."""
        intent = self.intent
        if isinstance(intent, Positioning | Tracking):
            return intent.target
        return JointTarget(self.goal)

    @property
    def following(self) -> Following | None:
        """The place on the plan that the arm is on, even if it is about to leave it."""
        if isinstance(self.mode, Following):
            return self.mode
        return self.mode.along if isinstance(self.mode, Leaving) else None

    @property
    def jogging(self) -> Jogging | None:
        """The jog under way; None if there is none."""
        return self.intent if isinstance(self.intent, Jogging) else None

    @property
    def servo(self) -> Stream | None:
        """The stream that is followed; None if there is none."""
        return self.intent.stream if isinstance(self.intent, Servoing) else None

    @property
    def since(self) -> ToolTarget | None:
        """Target up to which a drag has been followed along its path; None without a drag."""
        return self.intent.since if isinstance(self.intent, Tracking) else None

    @property
    def beyond_gap(self) -> Projection | None:
        """The pose of a drag that only a leap reaches; None without one."""
        return self.intent.beyond_gap if isinstance(self.intent, Positioning) else None

    @cached_property
    def moving(self) -> bool:
        """True if the arm or the gripper is still under way."""
        if self.report is not None and self.report.mode is ArmMode.MOVING:
            return True
        resting = self.blocked or self.paused or self.stopped is not None
        return self.under_way and not (resting and self.motion.at_rest)

    @property
    def objects_move(self) -> bool:
        """True if a loose object moves, which may be too little to be shown."""
        return self.bodies is not None and not self.bodies.resting.all()

    @property
    def setpoint(self) -> FloatArray:
        """The joint angles that the driver receives, (n,) [rad]."""
        return self.motion.q

    @property
    def x(self) -> FloatArray:
        """Where the arm is: the joints and then the finger joint, (n + 1,) [rad]."""
        return np.append(self.q, self.gripper)

    @property
    def x_setpoint(self) -> FloatArray:
        """The setpoint of the joints and then of the finger joint, (n + 1,) [rad]."""
        return np.append(self.setpoint, self.gripper_setpoint)

    @property
    def held(self) -> SceneObject | None:
        """The object that the fingers hold; None if there is none."""
        return next((scene_object for scene_object in self.objects if scene_object.held), None)

    @cached_property
    def under_way(self) -> bool:
        """True if the setpoints differ from the goals, even if the arm waits."""
        return bool(
            (self.setpoint != self.goal).any()
            or not self.motion.at_rest
            or self.jogging is not None
            or self.servo is not None
            or (self.following is not None and not self.following.there)
            or self.gripper_setpoint != self.gripper_goal
        )
