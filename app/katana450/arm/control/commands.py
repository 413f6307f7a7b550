"""Everything a person, a script or a program can ask of the arm.

A command is a value. It is checked when it is made, so whatever reaches the session is finite and
of the right shape; whether the arm can do it is the session's to judge.
"""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.checked import check_finite, vector
from katana450.arm.control.thing_commands import (
    THINGS,
    Attach,
    Dress,
    Fill,
    Furnish,
    Place,
    Remove,
    Shift,
)
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.reading import Reading
from katana450.maths.kinematics.velocity import JogFrame
from katana450.maths.planning.plan import Plan

__all__ = [
    "JOG_TIME",
    "LEAST_SPEED",
    "THINGS",
    "Attach",
    "Batch",
    "ClearStop",
    "Command",
    "Dress",
    "EndDrag",
    "Fill",
    "Follow",
    "Furnish",
    "GoAlong",
    "GoToZero",
    "Hold",
    "Home",
    "Jog",
    "MoveTool",
    "Pause",
    "Place",
    "Remove",
    "Resume",
    "Servo",
    "SetAxes",
    "SetGripper",
    "SetJoint",
    "SetJoints",
    "SetPose",
    "SetReading",
    "SetTool",
    "Shift",
    "SpeedScale",
    "Stop",
    "TakeBranch",
    "TurnTool",
]

LEAST_SPEED = 0.01
"""A share below this is a hold, for which there are Pause and Stop."""

JOG_TIME = 0.2
"""[s] How long a jog goes on by itself."""


@dataclass(frozen=True)
class SetJoint:
    """Drive one joint to ``value`` [rad]; ``axis`` counts from 0."""

    axis: int
    value: float

    def __post_init__(self) -> None:
        if isinstance(self.axis, bool) or not isinstance(self.axis, int) or self.axis < 0:
            raise InputError(f"An axis is a whole number from 0, not {self.axis!r}.")
        check_finite(f"The angle of axis {self.axis + 1}", self.value)


@dataclass(frozen=True)
class SetAxes:
    """Drive some joints, each (axis, value): the value in [rad], the axis counted from 0.

    The others go on to where they were going.
    """

    values: tuple[tuple[int, float], ...]

    def __post_init__(self) -> None:
        for axis, value in self.values:
            SetJoint(axis, value)


@dataclass(frozen=True, eq=False)
class SetJoints:
    """Drive all joints to ``q``, (n,) [rad]."""

    q: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", vector("The joint vector", self.q, None))


@dataclass(frozen=True, eq=False)
class Servo:
    """Keep up with ``q``, (n,) [rad], which is one of a stream; for JOG_TIME after the last.

    qd: (n,) how fast it changes [rad/s]; without it that is seen from the stream. t: when it came
    [s], on the clock of ``State.t``; None for the tick that takes it.
    """

    q: FloatArray
    qd: FloatArray | None = None
    t: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", vector("The joint vector", self.q, None))
        if self.qd is not None:
            object.__setattr__(self, "qd", vector("The joint rates", self.qd, self.q.size))
        if self.t is not None:
            check_finite("The time of the sample", self.t)


@dataclass(frozen=True, eq=False)
class MoveTool:
    """Bring the tool point to ``position``, (3,) [m] in {S}; pitch and roll stay as wished."""

    position: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", vector("The tool position", self.position, 3))


@dataclass(frozen=True)
class TurnTool:
    """Give the tool a pitch and a roll [rad]; its position stays as wished.

    ``pitch`` is the angle of the tool below the horizontal, theta2 + theta3 + theta4, and ``roll``
    the turn about the tool's own axis, theta5: the two rotations a 5-axis arm is free to choose.
    """

    pitch: float
    roll: float

    def __post_init__(self) -> None:
        check_finite("The pitch", self.pitch)
        check_finite("The roll", self.roll)


@dataclass(frozen=True, eq=False)
class SetPose:
    """Bring the tool to the pose ``T``, (4, 4) in {S}, as near as five axes can."""

    T: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T", frozen(se3.validated(self.T)))


@dataclass(frozen=True)
class SetGripper:
    """Drive the finger joint to ``angle`` [rad]."""

    angle: float

    def __post_init__(self) -> None:
        check_finite("The finger angle", self.angle)


@dataclass(frozen=True)
class SetTool:
    """From now on targets and read-outs are of the tool frame ``name``; nothing moves."""

    name: str


@dataclass(frozen=True)
class SetReading:
    """From now on ``reading`` says which numbers of a target count; the one there is, is reread."""

    reading: Reading

    def __post_init__(self) -> None:
        if self.reading not in tuple(Reading):
            known = ", ".join(f"Reading.{reading.name}" for reading in Reading)
            raise InputError(f"A reading is one of {known}, not {self.reading!r}.")


@dataclass(frozen=True)
class TakeBranch:
    """Go for the wished pose on ``branch``, however far that is: the same tool, another arm."""

    branch: Branch

    def __post_init__(self) -> None:
        if self.branch not in BRANCHES:
            known = ", ".join(str(branch) for branch in BRANCHES)
            raise InputError(f"A branch is one of {known}, not {self.branch!r}.")


@dataclass(frozen=True)
class EndDrag:
    """End a drag: the nearest pose that the arm can reach becomes the target."""


@dataclass(frozen=True)
class Home:
    """Drive to the ready posture."""


@dataclass(frozen=True)
class GoToZero:
    """Drive to the zero posture, the arm stretched along x (paper, Fig. 2)."""


@dataclass(frozen=True)
class Hold:
    """Come to rest and forget the targets of arm and gripper."""


@dataclass(frozen=True)
class Stop:
    """Come to rest as fast as the arm can, and accept no motion until ClearStop."""


@dataclass(frozen=True)
class ClearStop:
    """Accept motion again after a stop. Nothing moves by this."""


@dataclass(frozen=True)
class Pause:
    """Come to rest on the way, and keep the goal."""


@dataclass(frozen=True)
class Resume:
    """Go on to the goal there is."""


@dataclass(frozen=True, eq=False)
class Follow:
    """Follow ``plan`` from its start, where the arm has to stand, to its end."""

    plan: Plan

    def __post_init__(self) -> None:
        if not isinstance(self.plan, Plan):
            raise InputError(f"What is to be followed is a plan, not {self.plan!r}.")


@dataclass(frozen=True)
class GoAlong:
    """Go on or back along the plan that is followed, to ``share`` of it: 0 its start, 1 its end."""

    share: float

    def __post_init__(self) -> None:
        check_finite("The share of the plan", self.share)
        if not 0.0 <= self.share <= 1.0:
            raise InputError(f"The share of the plan is from 0 to 1, not {self.share}.")


@dataclass(frozen=True)
class SpeedScale:
    """From now on no joint and no tool is faster than ``value`` of its most, above 0 up to 1."""

    value: float

    def __post_init__(self) -> None:
        check_finite("The speed", self.value)
        if not LEAST_SPEED <= self.value <= 1.0:
            raise InputError(f"The speed is a share from {LEAST_SPEED} to 1, not {self.value}.")


@dataclass(frozen=True, eq=False)
class Jog:
    """Move at ``rates`` (5,) for JOG_TIME: vx, vy, vz [m/s] along ``frame``, pitch, roll [rad/s].

    Sent again and again while a hand holds on; when it does not come the arm comes to rest.
    """

    rates: FloatArray
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        object.__setattr__(self, "rates", vector("The jog", self.rates, 5))
        if not isinstance(self.frame, JogFrame):
            raise InputError(f"A jog is along JogFrame.BASE or JogFrame.TOOL, not {self.frame!r}.")


@dataclass(frozen=True, eq=False)
class Batch:
    """Several commands in one tick: all of them, or none if one is invalid."""

    commands: tuple[Command, ...]

    def __post_init__(self) -> None:
        if any(isinstance(each, Batch) for each in self.commands):
            raise InputError("A batch cannot contain another batch: list its commands singly.")


Command = (
    SetJoint
    | SetAxes
    | SetJoints
    | Servo
    | MoveTool
    | TurnTool
    | SetPose
    | SetGripper
    | SetTool
    | SetReading
    | TakeBranch
    | EndDrag
    | Home
    | GoToZero
    | Hold
    | Stop
    | ClearStop
    | Pause
    | Resume
    | Follow
    | GoAlong
    | Place
    | Remove
    | Attach
    | Furnish
    | Fill
    | Shift
    | Dress
    | Batch
    | SpeedScale
    | Jog
)
