"""Recorded ticks: their messages, the digests of the states after them, and their simulation.

What a simulation finds by itself is left out of a message: the time of the state before, unless the
arm rested, and the answer of the driver, unless it differs from the setpoint. The rules are a pure
function, so the same commands at the same times give the same states, to the bit, with the same
libraries and rounding.

A digest is a few bytes that differ if any number, text or choice in a state differs. It covers
every field bit by bit: it is BLAKE2b of the fields in MessagePack, which holds numbers in binary
and is made by compiled code, so that a digest takes a tenth of the time of the text form. A plan
counts by its length alone: the commands hold it, and the place on it is in the digest.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import msgspec
import numpy as np

from katana450.arm.control.commands.commands import Batch, Command, Stop
from katana450.arm.control.lease import Actor
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import with_name
from katana450.arm.control.state.arm_report import ArmReport
from katana450.arm.control.state.modes import Following, Leaving, Mode, Positioning, Tracking
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.arm.control.state.stop_cause import StopCause
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import Submission, TickRecord, failed, stepped
from katana450.errors import InputError, KatanaError
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.former_forms import target_content
from katana450.extensions.recording.forms import FormError
from katana450.extensions.recording.messages import GivenCommand, SentAnswer, TickMessage
from katana450.maths.geometry.arrays import FloatArray

DIGEST_DIGITS = 10
"""Length of a digest. One of 10^10 states that differ has the same digest by chance. Decimal digits
take less room than others beside numbers."""

APART = ("t", "mode", "objects", "bodies")
PLAIN = tuple(field.name for field in fields(State) if field.name not in APART)
AS_MADE: Mapping[str, tuple[()]] = {"changed": ()}
"""The appearance of the links, which older versions could paint and hide."""


def _hook(value: Any) -> Any:
    """Return the content of a value that MessagePack does not know."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"A {type(value).__name__} has no digest.")


class Digester:
    """Makes the digests of the states of one session, one after another."""

    def __init__(self) -> None:
        self._encoder = msgspec.msgpack.Encoder(enc_hook=_hook)
        self._objects: tuple[SceneObject, ...] = ()
        self._of_objects = b""

    def content(self, state: State) -> bytes:
        """Return all of ``state`` but its time, as bytes that differ if it differs.

        Raises FormError for a text that is not Unicode.
        """
        try:
            return self._content(state)
        except UnicodeEncodeError as error:
            raise FormError(f"it is not Unicode: {error}") from None

    def _content(self, state: State) -> bytes:
        if state.objects is not self._objects or not self._of_objects:
            # They change seldom, and many states share them.
            self._objects = state.objects
            self._of_objects = hashlib.blake2b(self._encoder.encode(state.objects)).digest()
        values = [getattr(state, name) for name in PLAIN]
        values.insert(PLAIN.index("report"), AS_MADE)
        content = values, self._of_objects, _mode(state.mode)
        # Older versions have none.
        bodies = () if state.bodies is None else (state.bodies,)
        return self._encoder.encode((*content, *bodies))

    def digest(self, state: State, content: bytes | None = None) -> str:
        """Return the digest of ``state``. ``content``: its content, if it is known."""
        content = self.content(state) if content is None else content
        digest = hashlib.blake2b(self._encoder.encode(state.t) + content, digest_size=8).digest()
        return f"{int.from_bytes(digest) % 10**DIGEST_DIGITS:0{DIGEST_DIGITS}d}"


def _mode(mode: Mode) -> tuple[Any, ...]:
    name = type(mode).__name__
    match mode:
        case Following(plan=plan):
            # Older versions could go back on a plan, to any place of it.
            return name, plan.span, mode.number, mode.pace, plan.span
        case Leaving(along=along, then=then):
            return name, _mode(along), _mode(then)
        case Positioning(target=target, beyond_gap=beyond):
            # Older versions had a detour there.
            return name, *target_content(target), beyond, None
        case Tracking():
            target, since = target_content(mode.target)[1], target_content(mode.since)[1]
            return name, {"target": target, "since": since, "let_go": mode.let_go}
    return name, mode


def without_identities(record: TickRecord) -> TickRecord:
    """Return ``record`` without keys and addresses of people: a file that is passed on has none.

    Names and roles stay. A key names the session of a browser. It does not influence the motion, so
    a simulation of these records gives the same motion.
    """
    state = record.state
    if state.stopped is not None and state.stopped.cause.key:
        stopped = replace(state.stopped, cause=replace(state.stopped.cause, key=""))
        state = replace(state, stopped=stopped)
    submissions = [
        Submission(_without_key(command), _without_identity(actor))
        for command, actor in record.submissions
    ]
    return record._replace(submissions=submissions, state=state)


def _without_key(command: Command) -> Command:
    match command:
        case Stop(cause=cause) if cause.key:
            return Stop(replace(cause, key=""), command.finding, command.others)
        case Batch(commands=commands):
            return Batch(tuple(map(_without_key, commands)))
    return command


def _without_identity(actor: Actor | None) -> Actor | None:
    return actor and replace(actor, person=replace(actor.person, key="", address=""))


@dataclass(frozen=True, eq=False)
class TickInput:
    """Input of a tick, and the digest of the state after it, as in ``TickMessage``."""

    t: float
    t_before: float | None
    submissions: tuple[Submission, ...]
    sent: DriverAnswer | None
    failed: bool
    named: StopCause | None
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
        codec.encoded(state.stopped.cause) if record.named and state.stopped else None,
        digest,
    )


def _is_at_setpoint(state: State) -> bool:
    """Return whether the arm is at its setpoint, to the bit."""
    same = state.q is state.setpoint or state.q.tobytes() == state.setpoint.tobytes()
    return same and repr(state.gripper) == repr(state.gripper_setpoint)


def tick_input(codec: Codec, message: TickMessage) -> TickInput:
    """Return the tick of ``message``. Raises FormError."""
    submissions, sent = [], None
    for place, text in enumerate(message.commands):
        try:
            command = codec.decoded(Command, text.command)
            submissions.append(Submission(command, codec.decoded(Actor | None, text.actor)))
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
    try:
        named = codec.decoded(StopCause | None, message.named)
    except FormError as error:
        raise error.within("named") from None
    # Its times are finite, as all numbers of JSON: compiled code of the simulation needs that.
    t, t_before = message.t, message.t_before
    return TickInput(t, t_before, tuple(submissions), sent, message.failed, named, message.digest)


@dataclass(frozen=True)
class Difference:
    """A tick in which the simulation differs from the recording.

    Attributes:
        t: time of the tick [s].
        size: largest difference of a joint's setpoint [rad or m]; 0 if only others differ.
    """

    t: float
    size: float


@dataclass(frozen=True)
class Verification:
    """The result of a comparison.

    Attributes:
        ticks: number of ticks that were compared.
        different: number of those that differ.
        first: the first difference; None if all are equal.
        largest: the tick with the largest difference of a setpoint; None if all are equal.
        unknown: number of ticks that cannot be simulated, because something before them is missing.
    """

    ticks: int = 0
    different: int = 0
    first: Difference | None = None
    largest: Difference | None = None
    unknown: int = 0

    @property
    def identical(self) -> bool:
        """True if every tick that was compared is the same to the bit."""
        return self.first is None

    def __str__(self) -> str:
        if self.first is None:
            text = f"identical to the bit over {self.ticks} ticks"
        else:
            assert self.largest is not None
            text = (
                f"first difference at t = {self.first.t:.3f} s, {self.first.size:.2g} rad; "
                f"{self.different} of {self.ticks} ticks differ, by up to "
                f"{self.largest.size:.2g} rad"
            )
        missing = f"; {self.unknown} ticks cannot be simulated" if self.unknown else ""
        return text + missing


def after(session: Session, before: State, tick: TickInput) -> State:
    """Return the state after ``tick``, as the control loop finds it.

    Raises InputError for a tick that the rules refuse, which no control loop has recorded.
    """
    commands = [submission.command for submission in tick.submissions]
    if tick.t_before is not None:
        before = replace(before, t=tick.t_before)
    names = () if tick.named is None else (tick.named,)
    if tick.failed:
        return with_name(failed(before, commands), names)

    def send(q: FloatArray, gripper: float, _t: float, _stopped: bool) -> DriverAnswer:
        return DriverAnswer(q, gripper) if tick.sent is None else tick.sent

    try:
        return with_name(stepped(session, before, commands, tick.t, send), names)
    except KatanaError as error:
        raise InputError(f"The tick at t = {tick.t:.3f} s was refused: {error}") from error
    except Exception as error:
        # The rules meet only valid states of their own robot, but a file can hold any.
        raise InputError(
            f"The tick at t = {tick.t:.3f} s cannot be simulated "
            f"({type(error).__name__}: {error}). The recording is of another robot, or was changed."
        ) from error


def check_fits(session: Session, state: State) -> None:
    """Raise InputError if ``state`` is of a robot with another number of joints."""
    n = len(session.ready)
    motion = state.motion
    if not math.isfinite(state.t):
        raise InputError(f"The recording is damaged: {state.t} is not the time of a state.")
    for values in (state.q, state.goal, motion.q, motion.qd, motion.qdd):
        if values.shape != (n,) or not np.isfinite(values).all():
            raise InputError(f"The recording is not of this robot, which has {n} joints.")
