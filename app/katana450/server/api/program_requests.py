"""Requests of the API that plan and run programs."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.arm.control.commands.act import MotionRequest, Request, Traits
from katana450.server.api.fields import MAX_REQUEST_BYTES

SLOWEST_SPEED = 0.01
"""Minimum fraction of its own speed at which a program can run."""

MAX_BREAKPOINTS = 100
"""Maximum number of breakpoints."""


class ProgramOrder(Enum):
    """An order to a program."""

    RUN = "run"
    STEP = "step"
    """Run one step, then wait."""
    PAUSE = "pause"
    RESUME = "resume"
    END = "end"
    """Bring the arm to rest and end the program."""
    CONTINUE = "continue"
    """Continue a program that has ended early, from where the arm stands."""
    REWIND = "rewind"
    """Set a simulated arm and its scene back to where its owner took over, and hold there."""


class Program(Request, frozen=True, kw_only=True):
    """Send a part of a script (see docs/programs.md); the script is planned after the last part.

    All parts except the last have ``more`` set. ``speed`` is the fraction of the script's own
    speed. The state reports the progress of the planning, its end, or the errors of the script by
    line. The last plan is kept: the same script is ready at once while posture, gripper, tool,
    scene and water are the same.

    A script with a ``scene``
    is refused unless that is the present one.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    text: Annotated[str, Meta(max_length=MAX_REQUEST_BYTES)]
    more: bool = False
    speed: Annotated[float, Meta(ge=SLOWEST_SPEED, le=1.0)] = 1.0


class Steer(MotionRequest, frozen=True, kw_only=True):
    """Run, step, pause, resume, end, continue or rewind the planned program.

    A program drives as a participant of its own, and its owner must stay connected. During
    planning, ``run`` and ``step`` take effect afterwards, unless the arm is commanded to move, hold
    or stop in between; ``pause`` makes it start paused, and ``end`` cancels the planning. A program
    that is to run from another posture or scene than it was planned for is planned again first. An
    arm that is paused when a program begins stays paused until ``resume``.

    ``run`` and ``step`` with ``at`` begin at this step, from 1, from where the arm stands; the
    steps before it are left out, except those that choose the tool frame or the speed. A program
    that runs is ended first; its arm must be at rest. ``continue`` resumes a program that was
    stopped, ended or failed, at the place of its path where the arm left it, after a motion back to
    the path if the arm has been moved. It chooses the tool frame of the run again, and is refused
    if the gripper or the scene has changed. ``rewind`` undoes all that has happened since the
    owner took over by moving the arm: posture, objects and water; then ``continue`` is possible.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    order: ProgramOrder
    at: Annotated[int, Meta(ge=1)] | None = None


class Breakpoints(Request, frozen=True, kw_only=True):
    """Set the steps, from 1, before which the present program pauses, in place of earlier ones.

    They last for all runs of scripts of this name, until another participant sends a script.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    steps: Annotated[tuple[Annotated[int, Meta(ge=1)], ...], Meta(max_length=MAX_BREAKPOINTS)]


class Preview(Request, frozen=True, kw_only=True):
    """Show arm, objects and water at a time of the planned program in the scene, before it runs.

    Attributes:
        at: [s] Time from the beginning of the program; 0 shows only its path. None hides the path
            too, and the reason why the planning failed, because another text is being edited.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    at: Annotated[float, Meta(ge=0.0)] | None


REQUESTS = (Program, Steer, Breakpoints, Preview)
"""All requests of this module."""
