"""Requests to the server: JSON objects of exactly these shapes.

``do`` names the request. A request with an ``id`` is answered; without one only a refusal is
sent. Lengths are in m, angles in rad, times in s. A pose is that of the tool, in the paper's frame
{S} at the shoulder or in the base frame on the table. The requests that are commands of the arm are
their classes in ``arm.control``.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Union

import msgspec
from msgspec import Meta

from katana450.arm.control.act import *
from katana450.arm.control.act import Id, MotionRequest, Request, Traits, tag_of
from katana450.arm.control.arm_commands import *
from katana450.arm.control.checked import decoded_field
from katana450.arm.control.joint_commands import *
from katana450.arm.control.motion_commands import *
from katana450.arm.control.object_commands import *
from katana450.arm.control.scene_objects import Attachment as Attachment
from katana450.arm.control.scene_objects import Shape as Shape
from katana450.arm.control.tool_commands import *
from katana450.errors import InputError
from katana450.server.api.fields import *
from katana450.server.api.fields import MAX_REQUEST_BYTES, MAX_STATES_PER_SECOND, ROOT
from katana450.server.api.lease_requests import *
from katana450.server.api.people_requests import *
from katana450.server.api.scene_requests import *
from katana450.server.api.scene_requests import FieldName
from katana450.server.api.stop_requests import *


class Heartbeat(Request, frozen=True, kw_only=True):
    """A heartbeat. The holder of the lease sends ten a second.

    Otherwise a moving arm stops, or pauses if it is simulated.

    Attributes:
        n: Number that the answer repeats, for measuring the round trip.
    """

    traits: ClassVar[Traits] = Traits(free=True, answered=True)

    n: int = 0


class Undo(MotionRequest, frozen=True):
    """Undo the last change of a goal, an object or a setting by this client.

    To undo a goal, the arm moves back to the earlier one. Refused while the arm is stopped, and
    without a change since the last stop or change of driver.
    """

    traits: ClassVar[Traits] = Traits(extension=True)


class Redo(MotionRequest, frozen=True):
    """Repeat the change by this client that was undone last, if no other change followed."""

    traits: ClassVar[Traits] = Traits(extension=True)


class Watch(Request, frozen=True, kw_only=True):
    """Send the state periodically from now on. A slow connection gets fewer states.

    When a stop begins, is confirmed or is cleared, the state is sent at once.

    Attributes:
        hz: Number of states per second; 0 ends the stream.
        fields: Fields of the VRML world whose values each state includes.
    """

    traits: ClassVar[Traits] = Traits(question=True)

    hz: Annotated[float, Meta(ge=0.0, le=MAX_STATES_PER_SECOND)]
    fields: tuple[FieldName, ...] = ()


class Query(Request, frozen=True, kw_only=True):
    """Send one answer now.

    Attributes:
        at: Subject of the answer, which has the same name: the state, the description of the arm,
            the event log, the branches, the timing of the control loop, the objects, the VRML
            world, or the poses of the links.
    """

    traits: ClassVar[Traits] = Traits(question=True, answered=True)

    at: Literal["state", "arm", "event_log", "branches", "loop", "objects", "world", "links"] = (
        "state"
    )


EVERY: tuple[type[Request], ...] = tuple(
    kind
    for kind in globals().values()
    if isinstance(kind, type) and issubclass(kind, Request) and "traits" in vars(kind)
)
"""The classes of all requests of this module."""

CORE = tuple(kind for kind in EVERY if not kind.traits.extension)
"""The classes of the requests that every server answers. Extensions answer more."""


class _Named(msgspec.Struct):
    id: Id = None
    do: Any = None


_names = msgspec.json.Decoder(_Named)


class RequestDecoder:
    """Decoder of the requests that a server answers, of the classes ``kinds``."""

    def __init__(self, added: tuple[type[Request], ...] = ()) -> None:
        """Accept the requests of CORE, and those of the classes ``added`` by extensions."""
        self.kinds: tuple[type[Request], ...] = (*CORE, *added)
        kinds: Any = Union[self.kinds]  # noqa: UP007
        self._decoder: msgspec.json.Decoder[Request] = msgspec.json.Decoder(
            kinds, dec_hook=decoded_field
        )
        self._known = {tag_of(kind.__name__) for kind in self.kinds}

    def decoded(self, text: str | bytes) -> Request:
        """Return the request in ``text``. Raises InputError with the reason if it is invalid."""
        if len(text) > MAX_REQUEST_BYTES:
            raise InputError(f"A request has at most {MAX_REQUEST_BYTES} bytes.")
        try:
            return self._decoder.decode(text)
        except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
            if isinstance(error.__cause__, InputError):
                raise error.__cause__ from None
            name = _named(text).do
            if isinstance(name, str) and name not in self._known:
                raise InputError(
                    f"This server has no request {name!r}. {ROOT}/openapi.json lists its requests."
                ) from error
            raise InputError(f"This is not a valid request: {error}.") from error


def id_of(text: str | bytes) -> Id:
    """Return the id in ``text``, which need not be a valid request; None without one."""
    return _named(text[:MAX_REQUEST_BYTES]).id


def _named(text: str | bytes) -> _Named:
    """Return the id and the name in ``text``; None for each that is missing."""
    try:
        return _names.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return _Named()
