"""Base classes of requests and answers, and the types of their fields."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec
from msgspec import Meta

if TYPE_CHECKING:
    # The process of STOP reads two requests and no commands.
    from katana450.arm.control.commands import Command

VERSION = 1

ROOT = f"/api/v{VERSION}"
"""Path under which the API is served by HTTP."""

API = "/api/"
"""Prefix of the paths whose refusals are JSON."""

STOP_PATHS = ("/stop", f"{ROOT}/stop")
"""Paths of STOP, for pages and for programs. They are always answered."""

MAX_REQUEST_BYTES = 1024
"""Maximum size of a request [bytes]."""

MAX_LINEAR_RATE = 0.5
"""Maximum linear jog rate [m/s]: more than the arm can reach, so a larger value is a mistake."""

MAX_ANGULAR_RATE = 3.0
"""Maximum angular jog rate [rad/s], for the same reason."""

MAX_LINEAR_STEP = 0.1
"""Maximum step of the tool point along one axis [m]."""

MAX_ANGULAR_STEP = 1.0
"""Maximum step of pitch or roll [rad]."""

MIN_SPEED, MAX_SPEED = 0.05, 1.0
"""Limits of the fraction of full speed."""

MAX_STATES_PER_SECOND = 100
"""Maximum rate of states [1/s]: the rate of the control loop."""

MIN_WAIT, MAX_WAIT = 0.1, 600.0
"""Limits of the time in which a motion that a request waits for has to end [s]."""

MAX_JOINTS = 32

Rates = Annotated[tuple[float, ...], Meta(min_length=5, max_length=6)]
"""Velocity of the tool point (x, y, z) [m/s], then the rates of pitch and roll [rad/s]; for arms
outside the five-axis family those of the rotations about x, y and z."""

Numbers = list[float]
Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
Row = tuple[float, float, float, float]
Matrix4 = tuple[Row, Row, Row, Row]

MAX_PRESS_LENGTH = 64
"""Maximum length of the text that identifies one press of STOP."""

Id = Annotated[int, Meta(ge=0, le=2**53 - 1)] | Annotated[str, Meta(max_length=64)] | None
Press = Annotated[str, Meta(min_length=1, max_length=MAX_PRESS_LENGTH)] | None
Name = Annotated[str, Meta(min_length=1, max_length=40)]
FieldValue = float | Annotated[list[float], Meta(min_length=1, max_length=4)] | None
NodeName = Annotated[str, Meta(min_length=1, max_length=100)]
Key = Annotated[str, Meta(pattern="^[0-9a-f]{1,64}$")]


class Frame(Enum):
    """Frame in which a pose is given."""

    SHOULDER = "shoulder"
    """The paper's frame {S}, where axes 1 and 2 cross."""
    BASE = "base"
    """The base frame, on the table under the control box."""


def tag_of(name: str) -> str:
    """Return the tag of the message class ``name``: ``clear_stop`` for ``ClearStop``."""
    return re.sub(r"(?<=.)([A-Z])", r"_\1", name).lower()


@dataclass(frozen=True, kw_only=True)
class RequestTraits:
    """Traits of one class of requests. The defaults are those of a command to the arm.

    Attributes:
        free: Whether the request costs nothing of the budget, even when that is used up.
        question: Whether the request changes nothing.
        answered: Whether the request is answered even without an ``id``.
        stream: Whether the request is one of a stream. It is answered at once, before the arm's
            process has taken it.
        for_program: Whether the request goes to the running program if the sender is its owner.
        safety: Whether the request is exempt from the rate limit.
        admin: Whether the request is for admins only, whom it costs nothing of the budget.
    """

    free: bool = False
    question: bool = False
    answered: bool = False
    stream: bool = False
    for_program: bool = False
    safety: bool = False
    admin: bool = False


COMMAND = RequestTraits()
"""Traits of a request for one command of the arm. It costs the processor time that it takes."""

ADMIN = RequestTraits(admin=True)
"""Traits of a request for admins, which works whatever others ask for."""

LEASE = RequestTraits(free=True)
"""Traits of a request about the lease."""


class Request(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="do",
    tag=tag_of,
):
    """Base of all requests; ``do`` is the name of the class as ``tag_of`` gives it.

    Each class declares ``traits``.

    Attributes:
        id: Number or text of the client's own, repeated in the answer.
        revocations: Number from a state or an answer. A command is refused if there was a stop or
            a change of driver since then.
        made: Time of its making on the client's own clock [s], in all requests of a connection or
            in none. The server compares it with the least delay so far. A jog, a step, a sample of
            a stream or another target that is late is refused, and a late heartbeat counts as old.
    """

    traits: ClassVar[RequestTraits]

    id: Id = None
    revocations: Annotated[int, Meta(ge=0)] | None = None
    made: float | None = None

    def command(self) -> Command | None:
        """Return the command of the request.

        None if it is no command, or if its command depends on the arm.
        """
        return None


class MotionRequest(Request, frozen=True, kw_only=True):
    """Base of the requests whose answer can come at the end of their motion.

    Attributes:
        wait: Maximum duration of the motion [s]. The answer then comes at its end and has ``end``,
            and the open connection counts as the heartbeat. Without it the answer comes at once.
    """

    wait: Annotated[float, Meta(ge=MIN_WAIT, le=MAX_WAIT)] | None = None


class Answer(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="is", tag=tag_of
):
    """Base of all answers; ``is`` names the class, and ``id`` is that of the request."""

    id: Id = None
