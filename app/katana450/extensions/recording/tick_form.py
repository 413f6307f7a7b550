"""Text form of a tick: what the control loop was given, and the digest of the state after it.

What a simulation finds by itself is left out: the time of the state before, unless the arm rested,
and the answer of the driver, unless it differs from the setpoint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from katana450.arm.control.actor import Actor
from katana450.arm.control.arm_report import ArmReport
from katana450.arm.control.commands import Command
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import Submission, TickRecord
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.form_error import FormError, shown
from katana450.maths.geometry.arrays import FloatArray

T_BEFORE, T, COMMANDS, SENT, FAILED, DIGEST = (
    "t_before",
    "t",
    "commands",
    "sent",
    "failed",
    "digest",
)
NAMES = frozenset((T_BEFORE, T, COMMANDS, SENT, FAILED, DIGEST))
MAX_COMMANDS = 10_000


@dataclass(frozen=True, eq=False)
class TickInput:
    """Input of a tick, and the digest of the state after it.

    Attributes:
        t: time of the tick [s].
        t_before: time of the state that it steps from [s]; None for that of the tick before.
        submissions: its commands, with who gave each.
        sent: the answer of the driver; None if it is the setpoint.
        failed: whether an internal error made the arm hold.
        digest: digest of the state after it.
    """

    t: float
    t_before: float | None
    submissions: tuple[Submission, ...]
    sent: DriverAnswer | None
    failed: bool
    digest: str


def tick_form(codec: Codec, record: TickRecord, t_before: float | None, digest: str) -> Any:
    """Return the form of ``record``. Raises FormError for a command that has no form.

    Args:
        codec: coder of the commands.
        record: the tick.
        t_before: time of the state of the tick before [s]; None if it is not known.
        digest: digest of the state of the tick.
    """
    form: dict[str, Any] = {T: record.t}
    if record.t_before != t_before:
        form[T_BEFORE] = record.t_before
    if record.submissions:
        form[COMMANDS] = [
            {
                "command": codec.encoded(Command, each.command),
                "actor": codec.encoded(Actor | None, each.actor),
            }
            for each in record.submissions
        ]
    state = record.state
    if not record.failed and (state.report or not _same(state.q, state.setpoint, state)):
        form[SENT] = {
            "q": codec.encoded(FloatArray, state.q),
            "gripper": codec.encoded(float, state.gripper),
        }
        if state.report is not None:
            form[SENT]["report"] = codec.encoded(ArmReport, state.report)
    if record.failed:
        form[FAILED] = True
    form[DIGEST] = digest
    return form


def _same(q: FloatArray, setpoint: FloatArray, state: State) -> bool:
    """Return whether the arm is at its setpoint, to the bit."""
    at_setpoint = q is setpoint or q.tobytes() == setpoint.tobytes()
    return at_setpoint and repr(state.gripper) == repr(state.gripper_setpoint)


def tick_input(codec: Codec, form: Any) -> TickInput:
    """Return the tick of ``form``. Raises FormError."""
    if not isinstance(form, dict) or not form.keys() <= NAMES:
        raise FormError(f"{shown(form)} is not a tick")
    submissions = form.get(COMMANDS, [])
    if not isinstance(submissions, list) or len(submissions) > MAX_COMMANDS:
        raise FormError(f"{shown(submissions)} are not commands of a tick")
    sent, digest, failed = form.get(SENT), form.get(DIGEST), form.get(FAILED, False)
    if not isinstance(digest, str) or type(failed) is not bool:
        raise FormError(f"{shown(form)} is not a tick")
    t, t_before = codec.decoded(float, form.get(T)), codec.decoded(float | None, form.get(T_BEFORE))
    # Compiled code of the simulation reads beyond its memory at a time that is not a number.
    if not (math.isfinite(t) and (t_before is None or math.isfinite(t_before))):
        raise FormError(f"{t} is not the time of a tick", (T,))
    return TickInput(
        t=t,
        t_before=t_before,
        submissions=tuple(
            _submission(codec, each, place) for place, each in enumerate(submissions)
        ),
        sent=None if sent is None else _sent(codec, sent),
        failed=failed,
        digest=digest,
    )


def _submission(codec: Codec, form: Any, place: int) -> Submission:
    if not isinstance(form, dict) or form.keys() != {"command", "actor"}:
        raise FormError(f"{shown(form)} is not a command with its giver", (COMMANDS, place))
    try:
        command = codec.decoded(Command, form["command"])
        actor = codec.decoded(Actor | None, form["actor"])
    except FormError as error:
        raise error.within(place).within(COMMANDS) from None
    return Submission(command, actor)


def _sent(codec: Codec, form: Any) -> DriverAnswer:
    if not isinstance(form, dict) or form.keys() - {"report"} != {"q", "gripper"}:
        raise FormError(f"{shown(form)} is not an answer of a driver", (SENT,))
    try:
        q = codec.decoded(FloatArray, form["q"])
        gripper = codec.decoded(float, form["gripper"])
        report = codec.decoded(ArmReport | None, form.get("report"))
        return DriverAnswer(q, gripper, report)
    except FormError as error:
        raise error.within(SENT) from None
