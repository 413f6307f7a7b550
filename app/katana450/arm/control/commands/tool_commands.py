"""Commands that move the tool to a target, by a step, or at rates."""

from __future__ import annotations

import math
from enum import Enum
from typing import Annotated, ClassVar

from msgspec import Meta
from msgspec.structs import force_setattr

from katana450.arm.control.commands.act import Command, MotionRequest, Name, Request, Traits
from katana450.arm.control.commands.checked import (
    Point,
    Rotation,
    ToolNumbers,
    ToolRates,
    Transform,
    check_finite,
    vector,
)
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.velocity import JogFrame

MAX_LINEAR_RATE = 0.5
"""Maximum linear jog rate [m/s]: more than the arm can reach, so a larger value is a mistake."""

MAX_ANGULAR_RATE = 3.0
"""Maximum angular jog rate [rad/s], for the same reason."""

MAX_LINEAR_STEP = 0.1
"""Maximum step of the tool point along one axis [m]."""

MAX_ANGULAR_STEP = 1.0
"""Maximum step of pitch or roll [rad]."""

MAX_ELBOW_TURN = math.tau
"""Maximum turn of the arm angle by one command [rad]."""


class Frame(Enum):
    """Frame in which a pose is given."""

    SHOULDER = "shoulder"
    """The paper's frame {S}, where axes 1 and 2 cross."""
    BASE = "base"
    """The base frame, on the table under the control box."""


class Position(Command, MotionRequest, frozen=True, eq=False):
    """Move the tool point to a position; the orientation of the target is kept.

    Attributes:
        p: (3,) Position [m] in ``frame``.
        frame: Frame of ``p``: {S} at the shoulder, or the base frame on the table.
    """

    traits: ClassVar[Traits] = Traits(stream=True, goal="drag")

    p: Point
    frame: Frame = Frame.SHOULDER

    def __post_init__(self) -> None:
        force_setattr(self, "p", vector("The tool position", self.p, 3))

    def in_shoulder(self, T_base_shoulder: FloatArray) -> Position:
        """Return the position in {S}, of which ``T_base_shoulder`` (4, 4) is the pose."""
        if self.frame is Frame.SHOULDER:
            return self
        T = se3.inverse(T_base_shoulder)
        return Position(T[:3, :3] @ self.p + T[:3, 3])


class Pose(Command, MotionRequest, frozen=True, eq=False):
    """Move the tool to a pose, or as near to it as the arm can.

    The priority (``set_priority``) decides which part of the pose is kept.

    Attributes:
        T: (4, 4) Pose of the tool in ``frame``, translations in m.
        frame: Frame of ``T``: {S} at the shoulder, or the base frame on the table.
    """

    traits: ClassVar[Traits] = Traits(stream=True, goal="pose")

    T: Transform
    frame: Frame = Frame.SHOULDER

    def __post_init__(self) -> None:
        se3.validated(self.T)
        force_setattr(self, "T", frozen(self.T))

    @property
    def target(self) -> FloatArray:
        """(4, 4) ``T`` with the nearest rotation: the numbers of ``T`` can be rounded."""
        return frozen(se3.validated(self.T))

    def in_shoulder(self, T_base_shoulder: FloatArray) -> Pose:
        """Return the pose in {S}, of which ``T_base_shoulder`` (4, 4) is the pose."""
        if self.frame is Frame.SHOULDER:
            return self
        return Pose(se3.inverse(T_base_shoulder) @ self.target)


class Turn(Command, MotionRequest, frozen=True):
    """Turn the tool of a five-axis arm to a pitch and a roll; its target position is kept.

    These are the two rotations that a five-axis arm is free to choose.

    Attributes:
        pitch: Angle of the tool below the horizontal [rad], positive downwards.
        roll: Angle about the tool's own axis [rad].
    """

    traits: ClassVar[Traits] = Traits(stream=True, goal="drag")

    pitch: float
    roll: float

    def __post_init__(self) -> None:
        check_finite("The pitch", self.pitch)
        check_finite("The roll", self.roll)

    def turned(self, target: ToolTarget, pan: FloatArray) -> ToolTarget:  # noqa: ARG002
        """Return ``target`` with this pitch and roll, which count from the pan (3, 3) of axis 1."""
        return ToolTarget(target.position, self.pitch, self.roll)


class Orient(Command, MotionRequest, frozen=True, eq=False):
    """Turn the tool of an arm outside the five-axis family; its target position is kept.

    Attributes:
        R: (3, 3) Rotation of the tool in ``frame``.
        frame: Frame of ``R``: {S} at the shoulder, or the base frame on the table.
    """

    traits: ClassVar[Traits] = Traits(stream=True, goal="drag")

    R: Rotation
    frame: Frame = Frame.SHOULDER

    def __post_init__(self) -> None:
        force_setattr(self, "R", frozen(so3.validated(self.R)))

    def in_shoulder(self, T_base_shoulder: FloatArray) -> Orient:
        """Return the rotation in {S}, of which ``T_base_shoulder`` (4, 4) is the pose."""
        if self.frame is Frame.SHOULDER:
            return self
        return Orient(T_base_shoulder[:3, :3].T @ self.R)

    def turned(self, target: ToolTarget, pan: FloatArray) -> ToolTarget:
        """Return ``target`` with this rotation, less the pan (3, 3) of axis 1."""
        return ToolTarget(target.position, rotation=frozen(pan.T @ self.R))


TurnCommand = Turn | Orient
"""A command that turns the tool; which one depends on the arm."""


class StepTool(Command, MotionRequest, frozen=True, eq=False):
    """Move the target of the tool by one step. Steps in a row add up.

    Where the target cannot be reached, the nearest pose becomes the target.

    Attributes:
        by: (5,) Step of the tool point (x, y, z) [m], then of pitch and roll [rad]. (6,) for arms
            outside the five-axis family: a rotation vector [rad] follows.
        frame: Frame along whose axes the tool point moves, `"base"` or `"tool"`; with six numbers
            it also turns about them.
    """

    traits: ClassVar[Traits] = Traits(relative=True, goal="step")

    by: ToolNumbers
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        step = _tool_numbers("step", self.by, MAX_LINEAR_STEP, MAX_ANGULAR_STEP)
        force_setattr(self, "by", step)
        _check_frame("step", self.frame)


class Jog(Command, Request, frozen=True, eq=False):
    """Move the tool at given rates for 0.2 s. Repeat the request to continue the motion.

    A client sends it repeatedly while a key, pad or stick is held.

    Attributes:
        rates: (5,) Velocity of the tool point (x, y, z) [m/s], then rates of pitch and roll
            [rad/s]. (6,) for arms outside the five-axis family: the rates of the rotations about x,
            y and z follow. (7,) for arms with an arm angle: its rate follows. It moves the elbow.
        frame: Frame along whose axes the tool point moves, `"base"` or `"tool"`; with six rates it
            also turns about them.
    """

    traits: ClassVar[Traits] = Traits(while_paused=False, at_once=True, goal="jog", gesture=True)

    rates: ToolRates
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        rates = _tool_numbers("jog", self.rates, MAX_LINEAR_RATE, MAX_ANGULAR_RATE, (5, 6, 7))
        force_setattr(self, "rates", rates)
        if rates[6:].any() and rates[:6].any():
            raise InputError("A jog moves the tool, or the elbow while the tool rests: not both.")
        _check_frame("jog", self.frame)

    @property
    def sample(self) -> bool:
        """True if it is refused when it arrives late; the end of a jog, without rates, is not."""
        return bool(self.rates.any())


class TurnElbow(Command, MotionRequest, frozen=True):
    """Turn the arm angle: the elbow moves about the line from shoulder to wrist, the tool rests.

    Turns in a row add up. A turn ends early at a limit of a joint, and before a contact. Only arms
    with seven turning axes have an arm angle.

    Attributes:
        by: Change of the arm angle [rad], counted from where the elbow is.
    """

    traits: ClassVar[Traits] = Traits(relative=True, goal="elbow", gesture=True)

    by: Annotated[float, Meta(ge=-MAX_ELBOW_TURN, le=MAX_ELBOW_TURN)]

    def __post_init__(self) -> None:
        check_finite("The turn of the elbow", self.by)
        if abs(self.by) > MAX_ELBOW_TURN:
            limit = math.degrees(MAX_ELBOW_TURN)
            raise InputError(f"The elbow turns by at most {limit:g} deg at a time.")


class EndDrag(Command, MotionRequest, frozen=True):
    """End a drag: the nearest pose that the arm can reach becomes the target."""

    traits: ClassVar[Traits] = Traits(joints_only=True, goal="drag", gesture=True)


class Tool(Command, Request, frozen=True):
    """Choose the tool frame to which targets and read-outs refer. Nothing moves.

    Attributes:
        name: Name of the tool frame; the answer ``arm`` lists them.
    """

    traits: ClassVar[Traits] = Traits(gesture=True)

    name: Name


class SetPriority(Command, Request, frozen=True):
    """Choose which part of a target is kept when the arm cannot satisfy all of it.

    A present target of the tool is projected again.

    Attributes:
        priority: The part that is kept first.
    """

    traits: ClassVar[Traits] = Traits(gesture=True)

    priority: Priority

    def __post_init__(self) -> None:
        if self.priority not in tuple(Priority):
            known = ", ".join(f"Priority.{priority.name}" for priority in Priority)
            raise InputError(f"A priority must be one of {known}, not {self.priority!r}.")


def _tool_numbers(
    what: str, value: object, linear: float, angular: float, sizes: tuple[int, ...] = (5, 6)
) -> FloatArray:
    """Return the numbers of a step or jog. Raises InputError for those beyond both limits."""
    numbers = vector(f"The {what}", value, None)
    if numbers.size not in sizes:
        known = " or ".join(map(str, sizes))
        raise InputError(f"The {what} must be {known} numbers, not {numbers.size}.")
    for place, number in enumerate(numbers.tolist()):
        limit = linear if place < 3 else angular
        if abs(number) > limit:
            raise InputError(f"The {what} has {number:g}, not between {-limit:g} and {limit:g}.")
    return numbers


def _check_frame(what: str, frame: object) -> None:
    if not isinstance(frame, JogFrame):
        raise InputError(
            f"The frame of a {what} must be JogFrame.BASE or JogFrame.TOOL, not {frame!r}."
        )
