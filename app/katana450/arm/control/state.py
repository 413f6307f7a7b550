"""The whole state of the session, one immutable value a tick."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from katana450.arm.control.appearance import ALL_AS_MADE, Appearance
from katana450.arm.control.modes import (
    IDLE,
    Following,
    Idle,
    Jogging,
    JointTarget,
    Leaving,
    Mode,
    PoseTarget,
    Positioning,
    Servoing,
    Target,
    ToolTarget,
    Tracking,
)
from katana450.arm.control.pouring import MotionWithWater
from katana450.arm.control.scene_objects import SceneObject
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.priority import Priority
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.motion.stream import Stream

__all__ = [
    "ACCEPTED",
    "Finding",
    "JointTarget",
    "Outcome",
    "PartRefusal",
    "PoseTarget",
    "Reason",
    "State",
    "Status",
    "StoppingDistance",
    "Target",
    "ToolTarget",
    "Verdict",
]


class Status(Enum):
    """How the goal of the arm stands to what was wished."""

    OK = "ok"
    LIMITED = "limited"
    PAUSED = "paused"
    BLOCKED = "blocked"
    GAP = "gap"
    STOPPED = "stopped"
    FAULT = "fault"


class Reason(Enum):
    """Why the goal differs from what was wished."""

    STOPPED = "stopped"
    PAUSED = "paused"
    CONTACT = "contact"
    ACROSS_GAP = "across a gap"
    OUT_OF_REACH = "out of reach"
    POSITION_CHANGED = "position changed"
    AXIS_1 = "axis 1 in the way"
    LINKS = "links reach no farther"
    SINGULAR = "singular"
    AXIS_LIMIT = "axis limit"
    SLIDE_LIMIT = "slide limit"
    GRIPPER_LIMIT = "gripper limit"
    GRIPPER_SLIDE_LIMIT = "gripper slide limit"
    YAW_FIXED = "yaw fixed"
    PITCH_CHANGED = "pitch changed"
    ROLL_CHANGED = "roll changed"
    NOT_AT_START = "not at the start"
    LOPSIDED = "one finger only"
    INTERNAL = "internal error"


GRIPPER_LIMITS = (Reason.GRIPPER_LIMIT, Reason.GRIPPER_SLIDE_LIMIT)
"""The reasons that are about the fingers alone."""


@dataclass(frozen=True)
class Finding:
    """One reason with its number.

    Attributes:
        reason: what holds the goal back.
        amount: by how much [m or rad]; for a limit, the limit itself [rad or m]; for a gap, the
            leap across it [rad]; for a contact, the distance that is left [m]; for a stop, how far
            the tool, or else any link, went until it was at rest [m]; for a plan, how far its start
            is [rad].
        axis: the axis it is about, counted from 0, where it is about one.
        parts: the two links or objects it is about, where it is about two.
        time: for a stop, how long that took [s].
    """

    reason: Reason
    amount: float = 0.0
    axis: int | None = None
    parts: tuple[str, str] | None = None
    time: float = 0.0


class Verdict(Enum):
    """How far a command takes effect."""

    ACCEPTED = "accepted"
    """As it was given."""
    LIMITED = "limited"
    """As far as the arm can; the findings say what is in the way."""
    REFUSED = "refused"
    """Not at all: nothing has changed."""


@dataclass(frozen=True)
class PartRefusal:
    """A refused part of a batch.

    Attributes:
        part: its place in the batch, from 0.
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
        verdict: how far it takes effect.
        findings: what limits it.
        why: the reason in words, where the verdict is REFUSED and no finding says it.
        refused: the parts of a batch that take no effect.
    """

    verdict: Verdict = Verdict.ACCEPTED
    findings: tuple[Finding, ...] = ()
    why: str = ""
    refused: tuple[PartRefusal, ...] = ()


ACCEPTED = Outcome()


@dataclass(frozen=True)
class StoppingDistance:
    """Distance that the tool, or else any link, travels until it is at rest [m], and the time that
    takes [s].
    """

    way: float
    time: float


@dataclass(frozen=True, eq=False)
class State:
    """Everything the session knows after a tick.

    Attributes:
        t: time of the tick [s].
        q, gripper: where the arm is, as the driver last said, (n,) and scalar [rad].
        motion, gripper_setpoint: what the driver is told in this tick, and how it moves.
        goal, gripper_goal: where the arm is going: the nearest it can do to the target.
        tool: the tool frame that targets and read-outs are of; empty where there are only joints,
            and then the branch and the reading say nothing.
        branch: the branch that dragging keeps.
        priority: which numbers of a target count, and what gives way.
        findings: why the goal is not what was last wished, or is not gone to; else empty.
        blocked: whether the arm waits on its way because it would touch something.
        stopped: the stop that holds the arm until it is cleared; None when there is none.
        paused: whether the arm waits on its way because a person wants it to.
        speed: the fraction of every greatest speed that is allowed, above 0 and up to 1.
        mode: what decides where the goal is. A drag is over once the goal is there; until then
            the findings are those from before.
        objects: what stands around or is held, and can be put elsewhere.
        grip: the angle of the finger joint at which an object is held [rad]; None with an empty
        hand.
        poured: the water of the cup; None where there is none.
        looks: how links and objects are shown.
        outcomes: what became of the commands of this tick, one for each.
    """

    t: float
    q: FloatArray
    gripper: float
    motion: JointMotion
    gripper_setpoint: float
    goal: FloatArray
    gripper_goal: float
    tool: str
    branch: Branch
    priority: Priority = Priority.POSE
    findings: tuple[Finding, ...] = ()
    blocked: bool = False
    stopped: StoppingDistance | None = None
    paused: bool = False
    speed: float = 1.0
    mode: Mode = IDLE
    objects: tuple[SceneObject, ...] = ()
    grip: float | None = None
    poured: MotionWithWater | None = None
    appearance: Appearance = ALL_AS_MADE
    outcomes: tuple[Outcome, ...] = ()

    @staticmethod
    def standing(
        q: FloatArray,
        gripper: float,
        t: float,
        tool: str,
        branch: Branch,
        objects: tuple[SceneObject, ...] = (),
    ) -> State:
        """Joints that stand at ``q`` (n,) and hold, with nothing asked of them yet."""
        return State(
            t=t,
            q=q,
            gripper=gripper,
            motion=JointMotion.rest(q),
            gripper_setpoint=gripper,
            goal=q,
            gripper_goal=gripper,
            tool=tool,
            branch=branch,
            objects=objects,
        )

    @property
    def status(self) -> Status:
        """What the findings come to."""
        if any(finding.reason is Reason.INTERNAL for finding in self.findings):
            return Status.FAULT
        if self.stopped is not None:
            return Status.STOPPED
        if self.paused:
            return Status.PAUSED
        if any(finding.reason is Reason.CONTACT for finding in self.findings):
            return Status.BLOCKED
        if any(finding.reason is Reason.ACROSS_GAP for finding in self.findings):
            return Status.GAP
        return Status.LIMITED if self.findings else Status.OK

    @property
    def intent(self) -> Idle | Positioning | Tracking | Jogging | Servoing | Following:
        """The mode, or the one that has superseded the plan which the arm is leaving."""
        return self.mode.then if isinstance(self.mode, Leaving) else self.mode

    @property
    def target(self) -> Target:
        """The target as it was given, or the goal in a mode that has none."""
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
        """The jog under way."""
        return self.intent if isinstance(self.intent, Jogging) else None

    @property
    def servo(self) -> Stream | None:
        """The stream that is followed."""
        return self.intent.stream if isinstance(self.intent, Servoing) else None

    @property
    def since(self) -> ToolTarget | None:
        """Target up to which a drag has been followed along its path; None without a drag."""
        return self.intent.since if isinstance(self.intent, Tracking) else None

    @property
    def moving(self) -> bool:
        """Whether the arm or the gripper is still on its way."""
        resting = self.blocked or self.paused or self.stopped is not None
        return self.under_way and not (resting and self.motion.at_rest)

    @property
    def setpoint(self) -> FloatArray:
        """Where the driver is told to be, (n,) [rad]."""
        return self.motion.q

    @property
    def x(self) -> FloatArray:
        """Where the arm is and its finger joint behind it, (n + 1,) [rad], as bodies are placed."""
        return np.append(self.q, self.gripper)

    @property
    def x_setpoint(self) -> FloatArray:
        """Likewise, where the driver is told to be."""
        return np.append(self.setpoint, self.gripper_setpoint)

    @property
    def near(self) -> frozenset[str]:
        """The links and objects that are about to touch."""
        met = (each.parts for each in self.findings if each.reason is Reason.CONTACT)
        return frozenset(part for parts in met for part in parts or ())

    @property
    def held(self) -> SceneObject | None:
        """What the fingers hold."""
        return next((each for each in self.objects if each.held), None)

    @property
    def under_way(self) -> bool:
        """Whether the setpoints differ from the goals, whatever stands between them."""
        return bool(
            (self.setpoint != self.goal).any()
            or not self.motion.at_rest
            or self.jogging is not None
            or self.servo is not None
            or (self.following is not None and not self.following.there)
            or self.gripper_setpoint != self.gripper_goal
        )
