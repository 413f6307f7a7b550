"""What requests and answers are made of: what they have in common, and their fields."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

VERSION = 1

ROOT = f"/api/v{VERSION}"
"""Where the API is by HTTP."""

MAX_REQUEST_BYTES = 1024
"""Bytes of a request."""

MAX_LINEAR_RATE = 0.5
"""[m/s] More than the arm can do; anything beyond is nobody's wish."""

MAX_ANGULAR_RATE = 3.0
"""[rad/s] Likewise."""

MIN_SPEED, MAX_SPEED = 0.05, 1.0
"""Fraction of full speed."""

MAX_STATES_PER_SECOND = 100
"""States a second that one can be told: as many as there are."""

MAX_JOINTS = 32

Rates = tuple[float, float, float, float, float]
"""Velocity of the tool point (x, y, z) [m/s], rates of pitch and roll [rad/s]."""

Numbers = list[float]
Vector3 = tuple[float, float, float]
Row = tuple[float, float, float, float]
Matrix4 = tuple[Row, Row, Row, Row]

MAX_PRESS_LENGTH = 64
"""Characters that tell one press of STOP from another."""

Id = Annotated[int, Meta(ge=0, le=2**53 - 1)] | Annotated[str, Meta(max_length=64)] | None
Press = Annotated[str, Meta(min_length=1, max_length=MAX_PRESS_LENGTH)] | None
Name = Annotated[str, Meta(min_length=1, max_length=40)]
FieldValue = float | Annotated[list[float], Meta(min_length=1, max_length=4)] | None
NodeName = Annotated[str, Meta(min_length=1, max_length=100)]
Key = Annotated[str, Meta(pattern="^[0-9a-f]{1,64}$")]


class Frame(Enum):
    """Whose coordinates a pose is in."""

    SHOULDER = "shoulder"
    """The paper's frame {S}, where axes 1 and 2 cross."""
    BASE = "base"
    """On the table under the control box."""


class Shape(Enum):
    """What an object counts as where contacts are looked for."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    MESH = "mesh"
    """A file that was uploaded; it counts as its convex hull."""


class Attachment(Enum):
    """What an object can be fixed to."""

    HAND = "hand"
    """It goes with the hand, whatever the fingers do, and counts as a part of it."""
    WORLD = "world"
    """It stays where it is."""
    TABLE = "table"
    """Likewise, once it is put down upright on the table below."""


def tag_of(name: str) -> str:
    """Return the tag of the message class ``name``: ``ClearStop`` is ``clear_stop``."""
    return re.sub(r"(?<=.)([A-Z])", r"_\1", name).lower()


@dataclass(frozen=True, kw_only=True)
class RequestTraits:
    """Traits of one class of requests. The default commands the arm.

    Attributes:
        free: costs nothing of the budget, however much else was asked.
        question: changes nothing.
        answered: is answered without an ``id`` too.
        stream: one of many in a row, answered at once, before the arm's process has taken it.
        for_program: is given to the program that runs, if the sender is its owner.
        safety: is never too frequent.
    """

    free: bool = False
    question: bool = False
    answered: bool = False
    stream: bool = False
    for_program: bool = False
    safety: bool = False


COMMAND = RequestTraits()
"""Traits of a request for one command of the arm, which costs what it takes."""

LEASE = RequestTraits(free=True)
"""Traits of a request about who holds the arm."""


class Request(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="do",
    tag=tag_of,
):
    """Base of all requests; ``do`` is the name of the class as ``tag_of`` gives it.

    Each class declares ``traits``. ``revocations``: of a state or an answer; a command is refused
    if there was a stop or a change of driver since then.
    """

    traits: ClassVar[RequestTraits]

    id: Id = None
    revocations: Annotated[int, Meta(ge=0)] | None = None


class Answer(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    omit_defaults=True,
    tag_field="is",
    tag=tag_of,
):
    """Base of all answers; ``is`` is the class name in lower case, ``id`` the request's."""

    id: Id = None
