"""The commands that give the joints their angles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from katana450.arm.control.checked import check_finite, vector
from katana450.arm.control.traits import BaseCommand, CommandTraits
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen

JOG_TIME = 0.2
"""[s] Time that a jog, or a sample of a joint stream, is followed without another one."""


class AxisCommand(BaseCommand, ABC):
    """Base of the commands that give single joints another target."""

    @abstractmethod
    def targets(self, goal: FloatArray) -> FloatArray:
        """Return the joint targets (n,) [rad], given the present goal (n,) [rad] of the joints.

        Raises InputError for an unknown axis.
        """


def with_axes(goal: FloatArray, values: tuple[tuple[int, float], ...]) -> FloatArray:
    """Return ``goal`` (n,) with new values for some axes, each (axis from 0, value [rad]).

    Raises InputError for an unknown axis.
    """
    q = np.array(goal)
    for axis, value in values:
        if axis >= q.size:
            raise InputError(f"There is no axis {axis + 1}: the robot has {q.size} axes.")
        q[axis] = value
    return frozen(q)


def check_axis(axis: object) -> None:
    """Raise InputError unless ``axis`` is a whole number from 0."""
    if isinstance(axis, bool) or not isinstance(axis, int) or axis < 0:
        raise InputError(f"An axis must be a whole number from 0, not {axis!r}.")


@dataclass(frozen=True)
class SetJoint(AxisCommand):
    """Move one joint to ``value`` [rad]; ``axis`` counts from 0."""

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True, joints_only=True)

    axis: int
    value: float

    def __post_init__(self) -> None:
        check_axis(self.axis)
        check_finite(f"The angle of axis {self.axis + 1}", self.value)

    def targets(self, goal: FloatArray) -> FloatArray:
        """Return ``goal`` (n,) [rad] with the value of the joint."""
        return with_axes(goal, ((self.axis, self.value),))

    def replaces(self, waiting: BaseCommand) -> bool:
        """Return whether ``waiting`` sets the same joint."""
        return isinstance(waiting, SetJoint) and waiting.axis == self.axis


@dataclass(frozen=True)
class SetAxes(AxisCommand):
    """Move some joints, each (axis, value): the value in [rad], the axis counted from 0.

    The other joints keep their goals.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(joints_only=True)

    values: tuple[tuple[int, float], ...]

    def __post_init__(self) -> None:
        for axis, value in self.values:
            SetJoint(axis, value)

    def targets(self, goal: FloatArray) -> FloatArray:
        """Return ``goal`` (n,) [rad] with the values of the joints."""
        return with_axes(goal, self.values)


@dataclass(frozen=True, eq=False)
class SetJoints(BaseCommand):
    """Move all joints to ``q``, (n,) [rad]."""

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True, joints_only=True)

    q: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", vector("The joint vector", self.q, None))


@dataclass(frozen=True, eq=False)
class Servo(BaseCommand):
    """Follow a stream of joint angles, of which ``q`` (n,) [rad] is one sample.

    The arm follows the stream for JOG_TIME after its last sample.

    Attributes:
        q: the sample.
        qd: (n,) its rate of change [rad/s]; None to estimate it from the stream.
        t: time of the sample [s], on the clock of ``State.t``; None for the time of the tick.
        gripper: target of the finger joint [rad or m]; None to leave it.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True, joints_only=True)

    q: FloatArray
    qd: FloatArray | None = None
    t: float | None = None
    gripper: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", vector("The joint vector", self.q, None))
        if self.gripper is not None:
            check_finite("The finger angle", self.gripper)
        if self.qd is not None:
            object.__setattr__(self, "qd", vector("The joint rates", self.qd, self.q.size))
        if self.t is not None:
            check_finite("The time of the sample", self.t)
