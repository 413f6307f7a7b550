"""Messages of ticks: what the control loop was given, and the digest of the state after it.

What a simulation finds by itself is left out: the time of the state before, unless the arm rested,
and the answer of the driver, unless it differs from the setpoint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from katana450.arm.control.actor import Actor
from katana450.arm.control.arm_report import ArmReport
from katana450.arm.control.commands import Command
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import Submission, TickRecord
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.forms import FormError
from katana450.maths.geometry.arrays import FloatArray

MAX_COMMANDS = 10_000


class GivenCommand(msgspec.Struct, forbid_unknown_fields=True):
    """The forms of a command and of its giver."""

    command: Any
    actor: Any


class SentAnswer(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """The forms of the answer of a driver."""

    q: Any
    gripper: Any
    report: Any = None


class TickMessage(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """One tick of the control loop, or the note that some are missing.

    Attributes:
        t: time of the tick [s].
        t_before: time of the state that it steps from [s]; None for that of the tick before.
        commands: its commands as the loop took them, with who gave each.
        sent: the answer of the driver; None if it is the setpoint.
        failed: whether an internal error made the arm hold.
        digest: digest of the state after it.
        missing: why this tick, and ``ticks`` before the next, cannot be simulated.
        ticks: number of missing ticks.
    """

    t: float
    t_before: float | None = None
    commands: Annotated[tuple[GivenCommand, ...], Meta(max_length=MAX_COMMANDS)] = ()
    sent: SentAnswer | None = None
    failed: bool = False
    digest: str = ""
    missing: str | None = None
    ticks: int = 1


@dataclass(frozen=True, eq=False)
class TickInput:
    """Input of a tick, and the digest of the state after it, as in ``TickMessage``."""

    t: float
    t_before: float | None
    submissions: tuple[Submission, ...]
    sent: DriverAnswer | None
    failed: bool
    digest: str


def tick_message(
    codec: Codec, record: TickRecord, t_before: float | None, digest: str
) -> TickMessage:
    """Return the message of ``record``. Raises FormError for a command that has no form.

    Args:
        codec: coder of the commands.
        record: the tick.
        t_before: time of the state of the tick before [s]; None if it is not known.
        digest: digest of the state of the tick.
    """
    state, sent = record.state, None
    if not record.failed and (state.report or not _is_at_setpoint(state)):
        sent = SentAnswer(*map(codec.encoded, (state.q, state.gripper, state.report)))
    return TickMessage(
        record.t,
        None if record.t_before == t_before else record.t_before,
        tuple(
            GivenCommand(codec.encoded(command), codec.encoded(actor))
            for command, actor in record.submissions
        ),
        sent,
        record.failed,
        digest,
    )


def _is_at_setpoint(state: State) -> bool:
    """Return whether the arm is at its setpoint, to the bit."""
    same = state.q is state.setpoint or state.q.tobytes() == state.setpoint.tobytes()
    return same and repr(state.gripper) == repr(state.gripper_setpoint)


def tick_input(codec: Codec, message: TickMessage) -> TickInput:
    """Return the tick of ``message``. Raises FormError."""
    t, t_before = message.t, message.t_before
    # Compiled code of the simulation reads beyond its memory at a time that is not a number.
    if not (math.isfinite(t) and (t_before is None or math.isfinite(t_before))):
        raise FormError(f"{t} is not the time of a tick", ("t",))
    submissions, sent = [], None
    for place, given in enumerate(message.commands):
        try:
            command = codec.decoded(Command, given.command)
            submissions.append(Submission(command, codec.decoded(Actor | None, given.actor)))
        except FormError as error:
            raise error.within(place).within("commands") from None
    if message.sent is not None:
        try:
            sent = DriverAnswer(
                codec.decoded(FloatArray, message.sent.q),
                codec.decoded(float, message.sent.gripper),
                codec.decoded(ArmReport | None, message.sent.report),
            )
        except FormError as error:
            raise error.within("sent") from None
    return TickInput(t, t_before, tuple(submissions), sent, message.failed, message.digest)
