"""Everything a person, a script or a program can ask of the arm.

A command is a value. It is checked when it is made, so whatever reaches the session is finite and
of the right shape; whether the arm can do it is the session's to judge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from app.control.looks import AS_MADE, LONGEST_NAME, Trait
from app.control.things import FARTHEST, MOST, Mount, Thing
from app.errors import InputError
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray, frozen
from app.kinematics.branch import BRANCHES, Branch
from app.kinematics.reading import Reading
from app.kinematics.velocity import JogFrame
from app.planning.plan import Plan

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
        _check_finite(f"The angle of axis {self.axis + 1}", self.value)


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
        object.__setattr__(self, "q", _vector("The joint vector", self.q, None))


@dataclass(frozen=True, eq=False)
class Servo:
    """Keep up with ``q``, (n,) [rad], which is one of a stream; for JOG_TIME after the last.

    qd: (n,) how fast it changes [rad/s]; without it that is seen from the stream.
    """

    q: FloatArray
    qd: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", _vector("The joint vector", self.q, None))
        if self.qd is not None:
            object.__setattr__(self, "qd", _vector("The joint rates", self.qd, self.q.size))


@dataclass(frozen=True, eq=False)
class MoveTool:
    """Bring the tool point to ``position``, (3,) [m] in {S}; pitch and roll stay as wished."""

    position: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", _vector("The tool position", self.position, 3))


@dataclass(frozen=True)
class TurnTool:
    """Give the tool a pitch and a roll [rad]; its position stays as wished.

    ``pitch`` is the angle of the tool below the horizontal, theta2 + theta3 + theta4, and ``roll``
    the turn about the tool's own axis, theta5: the two rotations a 5-axis arm is free to choose.
    """

    pitch: float
    roll: float

    def __post_init__(self) -> None:
        _check_finite("The pitch", self.pitch)
        _check_finite("The roll", self.roll)


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
        _check_finite("The finger angle", self.angle)


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
class Settle:
    """The hand lets go: what the arm can do becomes what is wished."""


@dataclass(frozen=True)
class Home:
    """Drive to the ready posture."""


@dataclass(frozen=True)
class Stretch:
    """Drive to the zero posture, the arm stretched along x (paper, Fig. 2)."""


@dataclass(frozen=True)
class Reset:
    """Forget the target: the arm holds where it is, and the gripper too."""


@dataclass(frozen=True)
class Stop:
    """Come to rest as fast as the arm can, and stay until a person says Release."""


@dataclass(frozen=True)
class Release:
    """After a stop: commands count again. Nothing moves by this."""


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
        _check_finite("The share of the plan", self.share)
        if not 0.0 <= self.share <= 1.0:
            raise InputError(f"The share of the plan is from 0 to 1, not {self.share}.")


@dataclass(frozen=True)
class SpeedScale:
    """From now on no joint and no tool is faster than ``value`` of its most, above 0 up to 1."""

    value: float

    def __post_init__(self) -> None:
        _check_finite("The speed", self.value)
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
        object.__setattr__(self, "rates", _vector("The jog", self.rates, 5))
        if not isinstance(self.frame, JogFrame):
            raise InputError(f"A jog is along JogFrame.BASE or JogFrame.TOOL, not {self.frame!r}.")


@dataclass(frozen=True)
class Place:
    """Put a thing where it says, in place of one of its name; what is held stays in the hand."""

    thing: Thing

    def __post_init__(self) -> None:
        if not isinstance(self.thing, Thing) or self.thing.held:
            raise InputError(f"What is put somewhere is a thing out of the hand, not {self.thing}.")


@dataclass(frozen=True)
class Fill:
    """Fill the cup with ``volume`` [m^3] of water, and wipe up what is elsewhere."""

    volume: float

    def __post_init__(self) -> None:
        _check_finite("The volume", self.volume)


@dataclass(frozen=True)
class Remove:
    """Take the thing of that name away; what is held stays."""

    name: str


@dataclass(frozen=True, eq=False)
class Shift:
    """Put the thing of that name elsewhere, or turn it; what is held stays.

    position: (3,) [m], R: (3, 3), of its frame in the base; None to keep what it has.
    """

    name: str
    position: FloatArray | None = None
    R: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.position is not None:
            position = _vector(f"The position of {self.name!r}", self.position, 3)
            if np.abs(position).max() > FARTHEST:
                raise InputError(f"{self.name!r} would be more than {FARTHEST:g} m away.")
            object.__setattr__(self, "position", position)
        if self.R is not None:
            R = so3.validated(self.R, f"The rotation of {self.name!r}")
            object.__setattr__(self, "R", frozen(R))


@dataclass(frozen=True)
class Dress:
    """Change one trait of how the link or thing ``name`` is shown; see ``Look.having``."""

    name: str
    trait: Trait
    value: float | tuple[float, ...] | None

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and 0 < len(self.name) <= LONGEST_NAME):
            raise InputError(
                f"A part's name has 1 to {LONGEST_NAME} characters, not {self.name!r}."
            )
        AS_MADE.having(self.trait, self.value)


@dataclass(frozen=True, eq=False)
class Together:
    """Several at once, in one tick: all of them, or none when one cannot be."""

    commands: tuple[Command, ...]

    def __post_init__(self) -> None:
        if any(isinstance(each, Together) for each in self.commands):
            raise InputError("Commands that are given together are single ones.")


@dataclass(frozen=True)
class Attach:
    """Fix the thing of that name to the hand, or to the world again; what is held stays."""

    name: str
    to: Mount

    def __post_init__(self) -> None:
        if not isinstance(self.to, Mount):
            raise InputError(f"A thing is fixed to one of {list(Mount)}, not {self.to!r}.")


@dataclass(frozen=True, eq=False)
class Furnish:
    """Have these things about and no others, at one go; what is held stays, as the only one of its
    name. ``volume``: of water in the cup [m^3]; None for no water anywhere."""

    things: tuple[Thing, ...]
    volume: float | None = None

    def __post_init__(self) -> None:
        names = {thing.name for thing in self.things}
        if len(names) < len(self.things) or len(names) > MOST:
            raise InputError(f"A scene has up to {MOST} things, each with a name of its own.")
        if any(thing.held for thing in self.things):
            raise InputError("What is put somewhere is a thing out of the hand.")
        if self.volume is not None:
            _check_finite("The volume", self.volume)


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
    | Settle
    | Home
    | Stretch
    | Reset
    | Stop
    | Release
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
    | Together
    | SpeedScale
    | Jog
)


THINGS = (Place, Shift, Attach, Furnish, Remove, Fill, Dress)
"""Those about what stands around and what is seen: no joint moves by them."""


def _check_finite(what: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{what} has to be a finite number, not {value!r}.")


def _vector(what: str, value: object, size: int | None) -> FloatArray:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what} has to be a list of numbers, not {value!r}.") from None
    if array.ndim != 1 or array.size == 0 or (size is not None and array.size != size):
        wanted = "a flat list" if size is None else f"{size} numbers"
        raise InputError(f"{what} has to be {wanted}, not an array of shape {array.shape}.")
    if not np.isfinite(array).all():
        raise InputError(f"{what} has to be finite: {array.tolist()}.")
    return frozen(array)
