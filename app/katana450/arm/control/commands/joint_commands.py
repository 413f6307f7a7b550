"""The commands that give the joints and the fingers their targets."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from msgspec.structs import force_setattr

from katana450.arm.control.commands.act import MAX_JOINTS, Command, MotionRequest, Request, Traits
from katana450.arm.control.commands.checked import JointVector, check_finite, vector
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen

JOG_TIME = 0.2
"""[s] Time that a jog, or a sample of a joint stream, is followed without another one."""

Axis = Annotated[int, Meta(ge=1, le=MAX_JOINTS)]
"""Number of a joint, counted from 1."""


class AxisCommand(Command, frozen=True):
    """Base of the commands that give single joints another target."""

    @abstractmethod
    def targets(self, goal: FloatArray) -> FloatArray:
        """Return the joint targets (n,) [rad], given the present goal (n,) [rad] of the joints.

        Raises InputError for an unknown axis.
        """


def with_axes(goal: FloatArray, values: tuple[tuple[int, float], ...]) -> FloatArray:
    """Return ``goal`` (n,) with new values for some axes, each (axis from 1, value [rad]).

    Raises InputError for an unknown axis.
    """
    q = np.array(goal)
    for axis, value in values:
        if axis > q.size:
            raise InputError(f"There is no axis {axis}: the robot has {q.size} axes.")
        q[axis - 1] = value
    return frozen(q)


def check_axis(axis: object) -> None:
    """Raise InputError unless ``axis`` is a whole number from 1."""
    if isinstance(axis, bool) or not isinstance(axis, int) or axis < 1:
        raise InputError(f"An axis must be a whole number from 1, not {axis!r}.")


class Joint(AxisCommand, MotionRequest, frozen=True):
    """Move one joint to a value.

    Attributes:
        axis: Number of the joint, counted from 1.
        value: Target [rad]; [m] for a joint that slides.
    """

    traits: ClassVar[Traits] = Traits(stream=True, joints_only=True, goal="joint")

    axis: Axis
    value: float

    def __post_init__(self) -> None:
        check_axis(self.axis)
        check_finite(f"The angle of axis {self.axis}", self.value)

    def targets(self, goal: FloatArray) -> FloatArray:
        """Return ``goal`` (n,) [rad] with the value of the joint."""
        return with_axes(goal, ((self.axis, self.value),))

    def replaces(self, waiting: Command) -> bool:
        """Return whether ``waiting`` sets the same joint."""
        return isinstance(waiting, Joint) and waiting.axis == self.axis


class SetAxes(AxisCommand, frozen=True):
    """Move some joints, each (axis, value): the value in [rad], the axis counted from 1.

    The other joints keep their goals.
    """

    traits: ClassVar[Traits] = Traits(joints_only=True, goal="joints", gesture=True)

    values: tuple[tuple[int, float], ...]

    def __post_init__(self) -> None:
        for axis, value in self.values:
            Joint(axis, value)

    def targets(self, goal: FloatArray) -> FloatArray:
        """Return ``goal`` (n,) [rad] with the values of the joints."""
        return with_axes(goal, self.values)


class Nudge(AxisCommand, MotionRequest, frozen=True):
    """Move one joint by a relative angle, counted from its goal. Nudges in a row add up.

    The new goal is limited to the range of the joint.

    Attributes:
        axis: Number of the joint, counted from 1.
        by: Change of the goal [rad]; [m] for a joint that slides.
    """

    traits: ClassVar[Traits] = Traits(relative=True, joints_only=True, goal="nudge")

    axis: Axis
    by: float

    def __post_init__(self) -> None:
        Joint(self.axis, self.by)

    def targets(self, goal: FloatArray) -> FloatArray:
        """Return ``goal`` (n,) [rad] with the angle of one joint changed by ``by``."""
        return frozen(goal + with_axes(np.zeros(goal.size), ((self.axis, self.by),)))


class Joints(Command, MotionRequest, frozen=True, eq=False):
    """Move all joints along a straight line in joint space; they arrive together.

    Attributes:
        q: (n,) Targets [rad]; [m] for joints that slide.
    """

    traits: ClassVar[Traits] = Traits(stream=True, joints_only=True, goal="joints")

    q: JointVector

    def __post_init__(self) -> None:
        force_setattr(self, "q", vector("The joint vector", self.q, None))


class Servo(Command, Request, frozen=True, eq=False):
    """Follow one sample of a stream of joint angles.

    The motion keeps the limits of speed, acceleration and jerk. The arm comes to rest when no
    other sample arrives for 0.2 s.

    Attributes:
        q: (n,) Joint angles [rad]; [m] for joints that slide.
        qd: (n,) Rates of ``q``. Without them the rates are estimated from the stream, which is less
            exact.
        gripper: Target of the finger joint [rad], or [m] if it slides; it stays without.
    """

    traits: ClassVar[Traits] = Traits(stream=True, joints_only=True, at_once=True)

    q: JointVector
    qd: JointVector | None = None
    gripper: float | None = None

    def __post_init__(self) -> None:
        force_setattr(self, "q", vector("The joint vector", self.q, None))
        if self.gripper is not None:
            check_finite("The finger angle", self.gripper)
        if self.qd is not None:
            force_setattr(self, "qd", vector("The joint rates", self.qd, self.q.size))

    def timed(self, t: float) -> TimedServo:
        """Return the sample with its time ``t`` [s]."""
        return TimedServo(self.q, self.qd, self.gripper, t)

    def replaces(self, waiting: Command) -> bool:
        """Return whether ``waiting`` is an earlier sample."""
        return isinstance(waiting, Servo)


class TimedServo(Servo, frozen=True, eq=False):
    """A sample of a stream with its time, which only the server gives.

    Attributes:
        t: Time of the sample [s], on the clock of ``State.t``.
    """

    t: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_finite("The time of the sample", self.t)


class Gripper(Command, MotionRequest, frozen=True):
    """Move the fingers.

    Attributes:
        angle: Target of the finger joint [rad]; [m] for fingers that slide. The answer ``arm`` has
            its range.
    """

    traits: ClassVar[Traits] = Traits(stream=True, supersedes=False, passive=True)

    angle: float

    def __post_init__(self) -> None:
        check_finite("The finger angle", self.angle)
