"""The part of the state about the present program."""

from __future__ import annotations

import msgspec


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """The program that is being planned, is running, or ran last.

    Attributes:
        name: Name of the program.
        by: Name of its owner.
        status: planning, cancelled, refused, ready, running, paused, blocked, done, stopped or
            failed.
        step: Number of the present step.
        steps: Number of steps.
        line: Line of the present step in the script.
        task: Present task in words.
        fraction: Fraction of the task that is done, or of all planning.
        seconds: Expected duration of the longest possible run, without awaited conditions [s].
        seconds_left: Expected time until the run ends [s], on the same clock; 0 if none runs.
        why: What is wrong with the program, why it was planned again or not run, or which times of
            the script it does not keep.
        skipped: Numbers of the steps of alternatives that the run has not taken.
        unattended: Whether it runs without heartbeats of its owner.
        began: Time at which the run began, in UTC, in ISO 8601; null before that.
        breakpoints: Numbers of the steps before which it pauses.
        can_continue: Whether it was interrupted, and nothing has changed that prevents continue.
    """

    name: str
    by: str
    status: str
    step: int = 0
    steps: int = 0
    line: int = 0
    task: str = ""
    fraction: float = 0.0
    seconds: float = 0.0
    seconds_left: float = 0.0
    why: str = ""
    skipped: tuple[int, ...] = ()
    unattended: bool = False
    began: str | None = None
    breakpoints: tuple[int, ...] = ()
    can_continue: bool = False
