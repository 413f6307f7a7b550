"""Commands about a whole motion, and about a real arm itself."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.arm.control.commands.act import Command, MotionRequest, Name, Request, Traits
from katana450.arm.control.commands.checked import check_finite
from katana450.arm.control.state.arm_report import ArmAct
from katana450.arm.control.state.state import Finding, State
from katana450.errors import InputError
from katana450.maths.planning.plan import Plan

MIN_SPEED = 0.01
"""Minimum fraction of speed. For a slower motion there are Pause and Stop."""


class Home(Command, MotionRequest, frozen=True):
    """Move to the ready posture."""

    traits: ClassVar[Traits] = Traits(joints_only=True, goal="home")


class GoToZero(Command, MotionRequest, frozen=True):
    """Move to the zero posture, in which the arm is stretched along x."""

    traits: ClassVar[Traits] = Traits(joints_only=True, goal="zero")


class Branch(Command, MotionRequest, frozen=True):
    """Move to the target pose on another branch: with another shoulder or elbow.

    Attributes:
        name: Name of the branch; the answer ``branches`` has it.
    """

    traits: ClassVar[Traits] = Traits(planned=True, goal="branch")

    name: Name


class Hold(Command, MotionRequest, frozen=True):
    """Come to rest and drop the target."""

    traits: ClassVar[Traits] = Traits(protective=True, joints_only=True)

    @property
    def finding(self) -> Finding | None:
        """Cause for which the server itself holds the arm."""
        return None


class HoldFor(Hold, frozen=True):
    """Hold the arm for a cause, which only the server gives. The arm pauses and reports it."""

    finding: Finding


class Pause(Command, Request, frozen=True):
    """Come to rest on the path and keep the target.

    The requests ``pause``, ``resume`` and ``speed`` also act on a running program. Only its owner
    may send them then: the page or API program that started it. A program that is being planned
    starts paused.
    """

    traits: ClassVar[Traits] = Traits(pacing=True, supersedes=False, joints_only=True)

    @property
    def finding(self) -> Finding | None:
        """Cause for which the server itself pauses the arm."""
        return None


class PauseFor(Pause, frozen=True):
    """Pause for a cause, which only the server gives. The program that drives may resume."""

    finding: Finding


class Resume(Command, MotionRequest, frozen=True):
    """Resume the motion after a pause."""

    traits: ClassVar[Traits] = Traits(pacing=True, supersedes=False, joints_only=True)


class Speed(Command, Request, frozen=True):
    """Set the maximum speed of every joint and of the tool.

    Attributes:
        value: Fraction of full speed.
    """

    traits: ClassVar[Traits] = Traits(
        pacing=True,
        protective=True,
        while_stopped=True,
        supersedes=False,
        passive=True,
        joints_only=True,
        gesture=True,
    )

    value: Annotated[float, Meta(ge=MIN_SPEED, le=1.0)]

    def __post_init__(self) -> None:
        check_finite("The speed", self.value)
        if not MIN_SPEED <= self.value <= 1.0:
            raise InputError(f"The speed must be from {MIN_SPEED} to 1, not {self.value}.")


class Follow(Command, frozen=True, eq=False):
    """Follow ``plan`` to its end from ``tau`` [s] of it, where the arm has to stand."""

    traits: ClassVar[Traits] = Traits()

    plan: Plan
    tau: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.plan, Plan):
            raise InputError(f"`plan` must be a Plan, not {self.plan!r}.")
        if not 0.0 <= self.tau < self.plan.span:
            raise InputError(f"`tau` must be from 0 to below {self.plan.span:g}, not {self.tau!r}.")


LAST_MINUTES = "ring"
"""Name of the recording of the present run."""

OWN_RUN = ("", LAST_MINUTES)
"""Recordings that a state of the present run is restored from."""


class RestoreState(Command, frozen=True, eq=False):
    """Continue from ``state``, one of an earlier run of the same robot, at the present time.

    Attributes:
        state: the state, with the time of its own run.
        recording: name of the recording that has it, such as LAST_MINUTES; empty if none has.
    """

    traits: ClassVar[Traits] = Traits(joints_only=True)

    state: State
    recording: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.state, State):
            raise InputError(f"`state` must be a State, not {self.state!r}.")

    @property
    def of_own_run(self) -> bool:
        """True if the state is one of the present run of the server."""
        return self.recording in OWN_RUN


class Batch(Command, frozen=True, eq=False):
    """Execute several commands in one tick: all of them, or none if one is invalid."""

    traits: ClassVar[Traits] = Traits(while_stopped=True, joints_only=True)

    commands: tuple[Command, ...]

    def __post_init__(self) -> None:
        if any(isinstance(command, Batch | RestoreState) for command in self.commands):
            raise InputError(
                "A batch cannot contain another batch or a state to restore: give them singly."
            )

    @property
    def parts(self) -> tuple[Command, ...]:
        """The commands of the batch."""
        return self.commands


class OperateArm(Command, Request, frozen=True):
    """Connect, calibrate or switch the motors of a real arm. It must be stopped and at rest.

    The state lists the acts that are possible; its ``arm.mode`` tells what becomes of an act.

    Attributes:
        act: connect; disconnect; calibrate: the arm moves to its mechanical stops; engage: the
            motors hold the arm, which was calibrated before; release: motors off, the arm falls;
            unblock: hold again after a collision or an error.
        confirmed: Whether a person has confirmed the hazard. Without it, an act that has one is
            refused with the text of the hazard.
    """

    traits: ClassVar[Traits] = Traits(while_stopped=True, joints_only=True)

    act: ArmAct
    confirmed: bool = False

    def __post_init__(self) -> None:
        if self.act.hazard and not self.confirmed:
            raise InputError(f"{self.act.hazard} Confirm this, and give the command again.")
