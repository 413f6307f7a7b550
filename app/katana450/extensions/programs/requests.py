"""Requests of the API that plan and run programs."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.server.api.fields import COMMAND, MAX_REQUEST_BYTES, Request, RequestTraits

SLOWEST_SPEED = 0.01
"""Smallest fraction of its own speed that a program can be run at."""


class ProgramOrder(Enum):
    """What a program can be told."""

    RUN = "run"
    STEP = "step"
    """Run one step, then wait."""
    PAUSE = "pause"
    RESUME = "resume"
    END = "end"
    """Come to rest and end it."""


class Program(Request, frozen=True, kw_only=True):
    """A part of a script, of docs/programs.md; after the last one it is planned.

    All but the last say ``more``. ``speed``: fraction of the script's own. The state tells how far
    the planning is, when it is done, or what is wrong with the script, line by line. The last plan
    is
    kept: the same script is ready at once while posture, gripper, tool, scene and water are the
    same.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    text: Annotated[str, Meta(max_length=MAX_REQUEST_BYTES)]
    more: bool = False
    speed: Annotated[float, Meta(ge=SLOWEST_SPEED, le=1.0)] = 1.0


class Steer(Request, frozen=True, kw_only=True):
    """Run, step, pause, resume or end the program that is planned.

    It drives by itself, under its own name; its owner has to stay connected. While it is being
    planned, ``run`` and ``step`` take effect afterwards, unless the arm is told to move, hold or
    stop in between; ``pause`` makes it start paused, and ``end`` cancels the planning. A program
    that is to run from another posture or scene than it was planned for is planned anew first. An
    arm that is paused when a program begins stays paused until ``resume``.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    order: ProgramOrder
