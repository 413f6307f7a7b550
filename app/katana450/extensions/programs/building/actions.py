"""Actions of a program: the commands that start each one, and the test for its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.modes import Following
from katana450.arm.control.state.state import Reason, State
from katana450.errors import InputError
from katana450.maths.planning.plan import Plan

ACTION_TIMEOUT = 10.0
"""[s] Timeout of a finger motion, and of an arm that is blocked."""


class Action:
    """One action of a program; by default one that commands nothing and takes no time.

    All methods are pure.
    """

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return the commands that start the action; ``speed`` is the program's fraction."""
        return ()

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        """Return whether it is done, ``waited`` [s] after its start.

        Raises InputError if the action failed.
        """
        return True

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        """Return the completed fraction, from 0 to 1; 0 if it is not known."""
        return 0.0


@dataclass(frozen=True, eq=False)
class FollowPlan(Action):
    """Follow ``plan`` to its end from ``tau`` [s] of it, 0 at its start.

    ``note``: a sentence on times of the script that the plan cannot keep; empty if it keeps them.
    """

    plan: Plan
    tau: float = 0.0
    note: str = ""

    def duration_at(self, speed: float) -> float:
        """Return the duration [s] at ``speed``, 1 for full, without the part before ``tau``."""
        return self.plan.duration_at(speed) * (1.0 - self.tau / self.plan.span)

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return the command to follow the plan."""
        return (cmd.Follow(self.plan, self.tau),)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        """Return whether the end is reached. Raises InputError if the arm has left the plan."""
        following = state.mode
        if not isinstance(following, Following) or not np.array_equal(state.goal, self.plan.end):
            if any(finding.reason is Reason.NOT_AT_START for finding in state.findings):
                raise InputError("The arm is not at the start of the step. Run the program again.")
            raise InputError("The arm was given another target.")
        return following.there

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        """Return the completed fraction of the plan; 0 until the arm follows it."""
        following = self.followed(state)
        return 0.0 if following is None else following.fraction

    def followed(self, state: State) -> Following | None:
        """Return the place on the plan; None while ``state`` follows another one or none.

        The plan of the step before is followed until the command arrives. A state that was restored
        has a copy of its plan.
        """
        following, plan = state.following, self.plan
        if following is None or following.plan is plan:
            return following
        other = following.plan
        same = other.span == plan.span and np.array_equal(other.end, plan.end)
        return following if same else None


@dataclass(frozen=True)
class MoveFingers(Action):
    """Drive the fingers to ``angle`` [rad].

    ``holding``: name of the object that they must hold then; "" if they may be empty. ``seconds``:
    expected duration [s].
    """

    angle: float
    holding: str = ""
    seconds: float = 0.0

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return the command that sets the finger angle."""
        return (cmd.Gripper(self.angle),)

    def done(self, state: State, waited: float) -> bool:
        """Return whether the fingers are at their goal.

        Raises InputError after ACTION_TIMEOUT, or if they do not hold what they must.
        """
        if waited > ACTION_TIMEOUT:
            raise InputError(f"The fingers did not reach their goal within {ACTION_TIMEOUT:g} s.")
        if state.gripper_setpoint != state.gripper_goal:
            return False
        held = "nothing" if state.held is None else state.held.name
        if self.holding and held != self.holding:
            if state.objects_move:
                # Fast fingers may not have come as far as their setpoint.
                return False
            raise InputError(
                f"The fingers have closed on {held} instead of {self.holding}, which is not where "
                "it was when the script was planned. Put it back, or run the script again to plan "
                f"for its present place. `if: {{held: {self.holding}}}` lets a script react."
            )
        return True


@dataclass(frozen=True, eq=False)
class GiveCommand(Action):
    """Give one command, and wait for its effect.

    Attributes:
        command: the command.
        has_effect: whether a state shows the effect. It raises InputError if there can be none.
    """

    command: cmd.Command
    has_effect: Callable[[State], bool]

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return the command."""
        return (self.command,)

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        """Return whether the effect is there."""
        return self.has_effect(state)


@dataclass(frozen=True)
class Wait(Action):
    """Wait for ``seconds`` [s] at rest."""

    seconds: float

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        """Return whether the time has passed."""
        return waited >= self.seconds

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        """Return the fraction of the time that has passed."""
        return min(waited / self.seconds, 1.0)


def use_tool(name: str) -> GiveCommand:
    """Return the action to use the tool frame ``name`` from now on."""
    return GiveCommand(cmd.Tool(name), lambda state: state.tool == name)


@dataclass(frozen=True)
class SetSpeed(Action):
    """Limit the speed to the fraction ``value`` of the program's speed."""

    value: float

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:
        """Return the command that sets the speed, at least MIN_SPEED."""
        return (cmd.Speed(self.scale(speed)),)

    def scale(self, speed: float) -> float:
        """Return the fraction of full speed for a program with the fraction ``speed``."""
        return max(self.value * speed, cmd.MIN_SPEED)


def expected_time(action: Action, speed: float) -> float:
    """Return the expected duration [s] of ``action`` at ``speed``, a fraction of full speed.

    It is 0 for an action that waits for a condition, because nobody knows when it holds.
    """
    match action:
        case FollowPlan():
            return action.duration_at(speed)
        case MoveFingers(seconds=seconds) | Wait(seconds=seconds):
            return seconds
    return 0.0


@dataclass(frozen=True, eq=False)
class Task:
    """One action of a program, with its place in the script.

    Attributes:
        number: index of its step, from 0; repetitions count separately.
        line: line of the script, from 1.
        name: name that is shown to people.
        action: the action.
        after: index of the task that follows; None for the next one. The number of tasks is the
            end of the program. After a ``ConditionalJump`` the condition decides.
    """

    number: int
    line: int
    name: str
    action: Action
    after: int | None = None
