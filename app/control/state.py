"""The whole state of the session, one immutable value a tick."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from app.geometry.arrays import FloatArray
from app.kinematics.branch import Branch
from app.kinematics.reading import Reading
from app.kinematics.tool import ToolTarget

__all__ = [
    "Finding",
    "JointTarget",
    "PoseTarget",
    "Reason",
    "State",
    "Status",
    "Target",
    "ToolTarget",
]


@dataclass(frozen=True, eq=False)
class JointTarget:
    """The joints themselves are wished for: ``q`` (n,) [rad]."""

    q: FloatArray


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """A full pose ``T`` (4, 4) in {S}: one number more than five axes can follow."""

    T: FloatArray


Target = JointTarget | ToolTarget | PoseTarget


class Status(Enum):
    """How the goal of the arm stands to what was wished."""

    OK = "ok"
    LIMITED = "limited"
    BLOCKED = "blocked"
    HELD = "held"
    FAULT = "fault"


class Reason(Enum):
    """Why the goal differs from what was wished."""

    CONTACT = "contact"
    ACROSS_GAP = "across a gap"
    OUT_OF_REACH = "out of reach"
    POSITION_CHANGED = "position changed"
    AXIS_LIMIT = "axis limit"
    GRIPPER_LIMIT = "gripper limit"
    YAW_FIXED = "yaw fixed"
    PITCH_CHANGED = "pitch changed"
    ROLL_CHANGED = "roll changed"
    INTERNAL = "internal error"


@dataclass(frozen=True)
class Finding:
    """One reason with its number.

    Attributes:
        reason: what holds the goal back.
        amount: by how much [m or rad]; for a limit, the limit itself [rad]; for a gap, the leap
            across it [rad]; for a contact, the distance that is left [m].
        axis: the axis it is about, counted from 0, where it is about one.
        parts: the two links or things it is about, where it is about two.
    """

    reason: Reason
    amount: float = 0.0
    axis: int | None = None
    parts: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False)
class State:
    """Everything the session knows after a tick.

    Attributes:
        t: time of the tick [s].
        q, gripper: where the arm is, as the driver last said, (n,) and scalar [rad].
        setpoint, gripper_setpoint: what the driver is told in this tick.
        goal, gripper_goal: where the arm is going: the nearest it can do to the target.
        tool: the tool frame that targets and read-outs are of.
        target: what was wished, kept as it was wished.
        branch: the branch that dragging keeps.
        reading: which numbers of a target count, and what gives way.
        findings: why the goal is not what was last wished, or is not gone to; else empty.
        stopped: whether the arm waits on its way because it would touch something.
        since: how far along its way the target has been followed, while the goal is still on its
            way to it; None once it is there. Until then the findings are those from before.
        let_go: whether the hand has let go meanwhile, so that the goal becomes the wish in the end.
    """

    t: float
    q: FloatArray
    gripper: float
    setpoint: FloatArray
    gripper_setpoint: float
    goal: FloatArray
    gripper_goal: float
    tool: str
    target: Target
    branch: Branch
    reading: Reading = Reading.POSE
    findings: tuple[Finding, ...] = ()
    stopped: bool = False
    since: ToolTarget | None = None
    let_go: bool = False

    @property
    def status(self) -> Status:
        """What the findings come to."""
        if any(finding.reason is Reason.INTERNAL for finding in self.findings):
            return Status.FAULT
        if any(finding.reason is Reason.CONTACT for finding in self.findings):
            return Status.BLOCKED
        if any(finding.reason is Reason.ACROSS_GAP for finding in self.findings):
            return Status.HELD
        return Status.LIMITED if self.findings else Status.OK

    @property
    def moving(self) -> bool:
        """Whether the arm or the gripper is still on its way."""
        return self.under_way and not self.stopped

    @property
    def under_way(self) -> bool:
        """Whether the setpoints differ from the goals, whatever stands between them."""
        return bool(
            (self.setpoint != self.goal).any() or self.gripper_setpoint != self.gripper_goal
        )
