"""All commands that a person, a script or a program can give to the arm.

A command is a value. It is checked when it is made, so every number in it is finite and every
array has the right shape. The session judges whether the arm can execute it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from katana450.arm.control.arm_commands import OperateArm
from katana450.arm.control.checked import check_finite, vector
from katana450.arm.control.joint_commands import (
    JOG_TIME,
    AxisCommand,
    Servo,
    SetAxes,
    SetJoint,
    SetJoints,
    with_axes,
)
from katana450.arm.control.object_commands import (
    Attach,
    Fill,
    MoveObject,
    PlaceObject,
    Remove,
    ReplaceScene,
    SetAppearance,
)
from katana450.arm.control.state import Finding
from katana450.arm.control.stop_commands import ClearStop, Stop
from katana450.arm.control.tool_commands import Jog, OrientTool, StepTool, TurnTool
from katana450.arm.control.traits import BaseCommand, CommandTraits
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.priority import Priority
from katana450.maths.planning.plan import Plan

__all__ = [
    "JOG_TIME",
    "MIN_SPEED",
    "Attach",
    "AxisCommand",
    "BaseCommand",
    "Batch",
    "ClearStop",
    "Command",
    "EndDrag",
    "Fill",
    "Follow",
    "Go",
    "GoAlong",
    "GoToZero",
    "Hold",
    "Home",
    "Jog",
    "MoveObject",
    "MoveTool",
    "Nudge",
    "OfferDetour",
    "OperateArm",
    "OrientTool",
    "Pause",
    "PlaceObject",
    "Remove",
    "ReplaceScene",
    "Resume",
    "Servo",
    "SetAppearance",
    "SetAxes",
    "SetGripper",
    "SetJoint",
    "SetJoints",
    "SetPose",
    "SetPriority",
    "SetTool",
    "SpeedScale",
    "StepTool",
    "Stop",
    "TakeBranch",
    "TurnTool",
]

MIN_SPEED = 0.01
"""Minimum fraction of speed. For a slower motion there are Pause and Stop."""


@dataclass(frozen=True, eq=False)
class MoveTool(BaseCommand):
    """Bring the tool point to ``position``, (3,) [m] in {S}; its target orientation stays."""

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True)

    position: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", vector("The tool position", self.position, 3))


@dataclass(frozen=True, eq=False)
class SetPose(BaseCommand):
    """Bring the tool to the pose ``T``, (4, 4) in {S}, or as near to it as the arm can."""

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True)

    T: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T", frozen(se3.validated(self.T)))


@dataclass(frozen=True)
class Nudge(AxisCommand):
    """Move one joint by the relative angle ``by`` [rad]; ``axis`` counts from 0.

    The angle counts from the joint's goal, so that several in a row add up. The limits of the joint
    limit it.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(relative=True, joints_only=True)

    axis: int
    by: float

    def __post_init__(self) -> None:
        SetJoint(self.axis, self.by)

    def targets(self, goal: FloatArray) -> FloatArray:
        """Return ``goal`` (n,) [rad] with the angle of one joint changed by ``by``."""
        return frozen(goal + with_axes(np.zeros(goal.size), ((self.axis, self.by),)))


@dataclass(frozen=True)
class SetGripper(BaseCommand):
    """Drive the finger joint to ``angle`` [rad]."""

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True, supersedes=False, passive=True)

    angle: float

    def __post_init__(self) -> None:
        check_finite("The finger angle", self.angle)


@dataclass(frozen=True)
class SetTool(BaseCommand):
    """Select the tool frame ``name`` for targets and read-outs; nothing moves."""

    traits: ClassVar[CommandTraits] = CommandTraits()

    name: str


@dataclass(frozen=True)
class SetPriority(BaseCommand):
    """Select the part of a target that is kept when the arm cannot satisfy all of it.

    A present target of the tool is projected again.
    """

    traits: ClassVar[CommandTraits] = CommandTraits()

    priority: Priority

    def __post_init__(self) -> None:
        if self.priority not in tuple(Priority):
            known = ", ".join(f"Priority.{priority.name}" for priority in Priority)
            raise InputError(f"A priority must be one of {known}, not {self.priority!r}.")


@dataclass(frozen=True)
class TakeBranch(BaseCommand):
    """Change to ``branch`` at the present target of the tool, however far that is."""

    traits: ClassVar[CommandTraits] = CommandTraits(planned=True)

    branch: AnyBranch

    def __post_init__(self) -> None:
        if not isinstance(self.branch, Branch | str):
            raise InputError(f"A branch must be one of the arm, not {self.branch!r}.")


@dataclass(frozen=True)
class EndDrag(BaseCommand):
    """End a drag: the nearest pose that the arm can reach becomes the target."""

    traits: ClassVar[CommandTraits] = CommandTraits(joints_only=True)


@dataclass(frozen=True)
class Home(BaseCommand):
    """Drive to the ready posture."""

    traits: ClassVar[CommandTraits] = CommandTraits(joints_only=True)


@dataclass(frozen=True)
class GoToZero(BaseCommand):
    """Drive to the zero posture, the arm stretched along x (paper, Fig. 2)."""

    traits: ClassVar[CommandTraits] = CommandTraits(joints_only=True)


@dataclass(frozen=True)
class Hold(BaseCommand):
    """Come to rest and drop the targets of arm and gripper.

    With a ``finding``, which only the server gives, the arm pauses and reports it as the cause.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(protective=True, joints_only=True)

    finding: Finding | None = None


@dataclass(frozen=True)
class Pause(BaseCommand):
    """Come to rest on the path, and keep the goal.

    With a ``finding``, which only the server gives, the program that drives may resume by itself.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(pacing=True, supersedes=False, joints_only=True)

    finding: Finding | None = None


@dataclass(frozen=True)
class Resume(BaseCommand):
    """Continue to the present goal."""

    traits: ClassVar[CommandTraits] = CommandTraits(pacing=True, supersedes=False, joints_only=True)


@dataclass(frozen=True, eq=False)
class Follow(BaseCommand):
    """Follow ``plan`` to its end from ``tau`` [s] of it, where the arm has to stand."""

    traits: ClassVar[CommandTraits] = CommandTraits()

    plan: Plan
    tau: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.plan, Plan):
            raise InputError(f"`plan` must be a Plan, not {self.plan!r}.")
        if not 0.0 <= self.tau < self.plan.span:
            raise InputError(f"`tau` must be from 0 to below {self.plan.span:g}, not {self.tau!r}.")


@dataclass(frozen=True, eq=False)
class OfferDetour(BaseCommand):
    """Offer ``plan``, from the goal of a drag to the pose beyond its gap; nothing moves."""

    traits: ClassVar[CommandTraits] = CommandTraits(supersedes=False, passive=True)

    plan: Plan


@dataclass(frozen=True)
class Go(BaseCommand):
    """Follow the detour on offer to the pose beyond the gap of the last drag."""

    traits: ClassVar[CommandTraits] = CommandTraits()


@dataclass(frozen=True)
class GoAlong(BaseCommand):
    """Continue or go back on the plan to ``fraction`` of it: 0 is its start, 1 its end."""

    traits: ClassVar[CommandTraits] = CommandTraits()

    fraction: float

    def __post_init__(self) -> None:
        check_finite("The fraction of the plan", self.fraction)
        if not 0.0 <= self.fraction <= 1.0:
            raise InputError(f"The fraction of the plan must be from 0 to 1, not {self.fraction}.")


@dataclass(frozen=True)
class SpeedScale(BaseCommand):
    """Limit the speed of every joint and of the tool to the fraction ``value`` of its maximum.

    value: from MIN_SPEED to 1.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(
        pacing=True,
        protective=True,
        while_stopped=True,
        supersedes=False,
        passive=True,
        joints_only=True,
    )

    value: float

    def __post_init__(self) -> None:
        check_finite("The speed", self.value)
        if not MIN_SPEED <= self.value <= 1.0:
            raise InputError(f"The speed must be from {MIN_SPEED} to 1, not {self.value}.")


@dataclass(frozen=True, eq=False)
class Batch(BaseCommand):
    """Execute several commands in one tick: all of them, or none if one is invalid."""

    traits: ClassVar[CommandTraits] = CommandTraits(while_stopped=True, joints_only=True)

    commands: tuple[Command, ...]

    def __post_init__(self) -> None:
        if any(isinstance(each, Batch) for each in self.commands):
            raise InputError("A batch cannot contain another batch: list its commands singly.")

    @property
    def parts(self) -> tuple[BaseCommand, ...]:
        """The commands of the batch."""
        return self.commands


Command = (
    SetJoint
    | SetAxes
    | Nudge
    | SetJoints
    | Servo
    | MoveTool
    | StepTool
    | TurnTool
    | OrientTool
    | SetPose
    | SetGripper
    | SetTool
    | SetPriority
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
    | OfferDetour
    | Go
    | GoAlong
    | PlaceObject
    | Remove
    | Attach
    | ReplaceScene
    | Fill
    | MoveObject
    | SetAppearance
    | Batch
    | OperateArm
    | SpeedScale
    | Jog
)
