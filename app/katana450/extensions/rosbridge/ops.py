"""Operations of the protocol rosbridge v2, as its clients send them.

Source: ROSBRIDGE_PROTOCOL.md of rosbridge_suite.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar, get_args

import msgspec
from msgspec import Meta

from katana450.arm.control.commands.act import Traits, tag_of
from katana450.errors import InputError
from katana450.extensions.rosbridge.names import (
    CANCEL,
    CLEAR_SERVICE,
    HOLD_SERVICE,
    STOP_SERVICE,
    resolved,
)

MAX_OP_BYTES = 327_680
"""Maximum size of an operation [bytes]: a long trajectory with rates and accelerations."""

MAX_THROTTLE = 3_600_000
"""Maximum interval of a topic [ms]."""

MAX_PROBLEM_LENGTH = 300
"""Maximum number of characters of the problem that a refusal repeats."""

OpId = Annotated[int, Meta(ge=-(2**53), le=2**53)] | Annotated[str, Meta(max_length=256)] | None
Name = Annotated[str, Meta(min_length=1, max_length=200)]
Type = Annotated[str, Meta(max_length=200)]

T = TypeVar("T", bound=msgspec.Struct)

FREE, STOP = Traits(free=True), Traits(free=True, safety=True)

NOTHING = msgspec.Raw(b"{}")


class Op(msgspec.Struct, frozen=True, kw_only=True, tag_field="op", tag=tag_of):
    """Base of all operations. Fields that the server does not use are ignored, as in rosbridge.

    Attributes:
        id: Number or text of the client's own, repeated in answers.
    """

    id: OpId = None

    @property
    def traits(self) -> Traits:
        """The traits of the operation: ``safety`` for the rate limit, ``free`` for the budget."""
        return Traits()


class Advertise(Op, frozen=True, kw_only=True):
    """Announce messages of a topic."""

    topic: Name
    type: Type


class Unadvertise(Op, frozen=True, kw_only=True):
    """End the announcement of a topic."""

    topic: Name


class Publish(Op, frozen=True, kw_only=True):
    """Send a message of a topic."""

    topic: Name
    msg: msgspec.Raw = NOTHING


class Subscribe(Op, frozen=True, kw_only=True):
    """Receive the newest message of a topic, at most each ``throttle_rate`` [ms].

    ``queue_length`` has no effect: older messages are dropped in any case.
    """

    topic: Name
    type: Type | None = None
    throttle_rate: Annotated[float, Meta(ge=0, le=MAX_THROTTLE)] = 0.0
    queue_length: int = 0
    fragment_size: int | None = None
    compression: str | None = None


class Unsubscribe(Op, frozen=True, kw_only=True):
    """End a subscription, or all of a topic if it has no ``id``."""

    topic: Name


class CallService(Op, frozen=True, kw_only=True):
    """Call a service."""

    service: Name
    args: msgspec.Raw = NOTHING

    @property
    def traits(self) -> Traits:
        """The traits of the service: what ends a motion or a stop costs nothing."""
        if (name := resolved(self.service)) == STOP_SERVICE:
            return STOP
        return FREE if name in (HOLD_SERVICE, CLEAR_SERVICE) or name.endswith(CANCEL) else Traits()


class SendActionGoal(Op, frozen=True, kw_only=True):
    """Send a goal to an action. ``feedback``: whether its progress is sent."""

    action: Name
    action_type: Type = ""
    args: msgspec.Raw = NOTHING
    feedback: bool = False


class CancelActionGoal(Op, frozen=True, kw_only=True):
    """Cancel the goal that was sent with this ``id``."""

    action: Name

    @property
    def traits(self) -> Traits:
        """The traits: a cancel costs nothing."""
        return FREE


AnyOp = (
    Advertise
    | Unadvertise
    | Publish
    | Subscribe
    | Unsubscribe
    | CallService
    | SendActionGoal
    | CancelActionGoal
)

_decoder: msgspec.json.Decoder[AnyOp] = msgspec.json.Decoder(AnyOp)
_known = {tag_of(kind.__name__) for kind in get_args(AnyOp)}


class _Named(msgspec.Struct):
    id: OpId = None
    op: Any = None


_names = msgspec.json.Decoder(_Named)


def decoded(text: str | bytes) -> AnyOp:
    """Return the operation in ``text``. Raises InputError with the reason if it is invalid."""
    if len(text) > MAX_OP_BYTES:
        raise InputError(f"A message has at most {MAX_OP_BYTES // 1024} KB.")
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        name = _named(text).op
        if isinstance(name, str) and name not in _known:
            known = ", ".join(sorted(_known))
            raise InputError(f"This server has no op {name[:40]!r}. It has {known}.") from error
        raise InputError(f"This is not a valid message of rosbridge: {problem(error)}") from error


def id_of(text: str | bytes) -> OpId:
    """Return the id in ``text``, which need not be a valid operation; None without one."""
    return _named(text[:MAX_OP_BYTES]).id


def _named(text: str | bytes) -> _Named:
    try:
        return _names.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return _Named()


def problem(error: Exception) -> str:
    """Return what ``error`` says is wrong, as a sentence of bounded length."""
    return f"{str(error)[:MAX_PROBLEM_LENGTH].rstrip('.')}."


def read(raw: msgspec.Raw, kind: type[T], what: str) -> T:
    """Return ``raw`` as a message of ``kind``; ``what`` names it in the refusal.

    Raises InputError for wrong, unknown and missing fields, and for numbers that are not finite.
    """
    try:
        return msgspec.json.decode(raw, type=kind)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise InputError(f"This is not {what}: {problem(error)}") from error
