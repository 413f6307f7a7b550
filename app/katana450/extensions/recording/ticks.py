"""Ticks and their messages: what the control loop was given, and the digest of the state after it.

What a simulation finds by itself is left out: the time of the state before, unless the arm rested,
and the answer of the driver, unless it differs from the setpoint.
"""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.actor import Actor
from katana450.arm.control.arm_report import ArmReport
from katana450.arm.control.commands import Command
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import Submission, TickRecord
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.forms import FormError
from katana450.extensions.recording.messages import GivenCommand, SentAnswer, TickMessage
from katana450.maths.geometry.arrays import FloatArray


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
    # Its times are finite, as all numbers of JSON: compiled code of the simulation needs that.
    return TickInput(
        message.t, message.t_before, tuple(submissions), sent, message.failed, message.digest
    )
