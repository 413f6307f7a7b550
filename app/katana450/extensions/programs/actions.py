"""What a program has the arm do, one thing at a time: how it is asked for, and when it is done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.modes import Following
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.state import Reason, State
from katana450.errors import InputError
from katana450.maths.planning.plan import Plan

ACTION_TIMEOUT = 10.0
"""[s] That fingers may take, and an arm may wait for what stands in its way."""


class Action(Protocol):
    """One of them. Its methods are pure."""

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:
        """What asks for it; ``speed`` is the fraction of the whole program."""
        ...

    def done(self, state: State, waited: float) -> bool:
        """Whether it is, ``waited`` [s] after it was asked for. Raises InputError if it fails."""
        ...

    def fraction(self, state: State, waited: float) -> float:
        """How much of it is, from 0 to 1."""
        ...


@dataclass(frozen=True, eq=False)
class FollowPlan:
    """Follow a plan to its end."""

    plan: Plan

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        return (cmd.Follow(self.plan),)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        following = state.mode
        if not isinstance(following, Following) or not np.array_equal(state.goal, self.plan.end):
            if any(finding.reason is Reason.NOT_AT_START for finding in state.findings):
                raise InputError("The arm does not stand where the step begins; run it again.")
            raise InputError("The arm was told to go elsewhere.")
        return following.there

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return 0.0 if state.following is None else state.following.fraction


@dataclass(frozen=True)
class MoveFingers:
    """Drive the fingers to ``angle`` [rad]."""

    angle: float

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        return (cmd.SetGripper(self.angle),)

    def done(self, state: State, waited: float) -> bool:
        if waited > ACTION_TIMEOUT:
            raise InputError("The fingers do not get where they are to go.")
        return state.gripper_setpoint == state.gripper_goal

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return float(state.gripper_setpoint == state.gripper_goal)


@dataclass(frozen=True)
class FillCup:
    """Fill the cup with ``volume`` [m^3]."""

    volume: float

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        return (cmd.Fill(self.volume),)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        if state.poured is None:
            raise InputError("There is no cup to fill.")
        return True

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return 1.0


@dataclass(frozen=True, eq=False)
class PutObject:
    """Have ``scene_object`` stand where it says."""

    scene_object: SceneObject

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        return (cmd.PlaceObject(self.scene_object),)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        return any(np.array_equal(each.T, self.scene_object.T) for each in state.objects)

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return 1.0


@dataclass(frozen=True)
class Wait:
    """Stand still for a time [s]."""

    seconds: float

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        return ()

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        return waited >= self.seconds

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return min(waited / self.seconds, 1.0)


@dataclass(frozen=True)
class UseTool:
    """Have the tool frame ``name`` from now on."""

    name: str

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        return (cmd.SetTool(self.name),)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        return state.tool == self.name

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return float(state.tool == self.name)


@dataclass(frozen=True)
class SetSpeed:
    """Be no faster than this fraction of the program's speed."""

    value: float

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:
        return (cmd.SpeedScale(max(self.value * speed, cmd.MIN_SPEED)),)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        return True

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        return 1.0


@dataclass(frozen=True, eq=False)
class Task:
    """One order of a program.

    number: of the step it belongs to, from 0, repetitions counted. line: of the script.
    name: what a person calls it.
    """

    number: int
    line: int
    name: str
    order: Action
