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

from katana450.arm.control.commands.act import *
from katana450.arm.control.commands.act import Id, MotionRequest, Name, Request, Traits, tag_of
from katana450.arm.control.commands.checked import Transform, decoded_field
from katana450.arm.control.commands.joint_commands import *
from katana450.arm.control.commands.motion_commands import *
from katana450.arm.control.commands.object_commands import *
from katana450.arm.control.commands.tool_commands import *
from katana450.arm.control.commands.tool_commands import Frame
from katana450.arm.control.state.scene_objects import Attachment as Attachment
from katana450.arm.control.state.scene_objects import Shape as Shape
from katana450.arm.control.state.scene_objects import Zone as Zone
from katana450.errors import InputError
from katana450.server.api.fields import *
from katana450.server.api.fields import (
    LEASE,
    MAX_REQUEST_BYTES,
    MAX_STATES_PER_SECOND,
    ROOT,
    FieldValue,
    Key,
    NodeName,
    Press,
)


class Hello(Request, frozen=True, kw_only=True):
    """The first line on the TCP port: it identifies the program.

    Attributes:
        name: Name of the program that others see.
        token: Token of an access link, where the server requires one.
    """

    traits: ClassVar[Traits] = Traits()

    name: Name
    token: Annotated[str, Meta(max_length=400)] = ""


class Stop(Request, frozen=True, kw_only=True):
    """Stop the arm as fast as possible. Every client may do this at any time.

    Attributes:
        press: Name of this press of STOP. A client that repeats an unanswered stop sends the same
            name, and the stop counts once: a late repetition does not undo a ``clear_stop`` in
            between.
    """

    traits: ClassVar[Traits] = Traits(free=True, safety=True)

    press: Press = None


class ClearStop(Request, frozen=True):
    """Clear a stop: the arm accepts motion again. Nothing moves, and old targets are dropped."""

    traits: ClassVar[Traits] = Traits(free=True)


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


class Acquire(Request, frozen=True):
    """Acquire the lease if it is free. A command does this by itself while the lease is free."""

    traits: ClassVar[Traits] = LEASE


class Take(Request, frozen=True):
    """Take the lease from its holder. For admins only."""

    traits: ClassVar[Traits] = LEASE


class Ask(Request, frozen=True):
    """Ask the holder of the lease to hand it over.

    While a program holds the lease, the owner of the program is asked.
    """

    traits: ClassVar[Traits] = LEASE


class Withdraw(Request, frozen=True):
    """Withdraw your own request for the lease."""

    traits: ClassVar[Traits] = LEASE


class ReleaseLease(Request, frozen=True):
    """Release the lease, so that others can acquire it."""

    traits: ClassVar[Traits] = LEASE


class Give(Request, frozen=True, kw_only=True):
    """Hand the lease over to another page or program.

    The holder may do this, and the owner of the running program, which ends the program.

    Attributes:
        to: Number of the page or program.
    """

    traits: ClassVar[Traits] = LEASE

    to: int


class Decline(Request, frozen=True, kw_only=True):
    """Decline the request of another page or program for the lease.

    The holder may do this, and the owner of the running program.

    Attributes:
        to: Number of the page or program.
    """

    traits: ClassVar[Traits] = LEASE

    to: int


class Rename(Request, frozen=True, kw_only=True):
    """Choose the name that others see. Refused if it is empty, too long or taken.

    Attributes:
        name: Name, of at most 24 characters. That of an access link cannot be changed.
    """

    traits: ClassVar[Traits] = Traits()

    name: Annotated[str, Meta(max_length=200)]


class Place(Request, frozen=True, kw_only=True, eq=False):
    """Create an object, or change one. Fields that are not given keep their values.

    Attributes:
        name: Name of the object.
        T: (4, 4) Pose in ``frame``; the object's own frame is in the middle of its underside. A new
            object without ``T`` is placed where there is room in front of the arm. An object that
            can be held, vessels and the basin are refused where nothing carries them: they stand
            on the table or on another object.
        near: (2,) Point of the table [m] in the base frame. A new object without ``T`` is placed
            there or near it, where there is room beside other objects and the arm in its ready
            posture.
        frame: Frame of ``T``: {S} at the shoulder, or the base frame on the table.
        shape: Shape that is checked for contacts.
        size: Size of the shape [m]: box (x, y, z), cylinder and vessel (radius, height), sphere
            (radius), plane (x, y; only drawn, it has no end). A mesh has that of its file.
        mesh: Key of the mesh, from the answer to its upload.
        can_be_held: Whether the fingers may touch the object; they hold it between both sides.
        zone: Rule for the arm in a space that all else passes through: the arm and what it carries
            keep out, or its tool moves at most at 250 mm/s. "none" for a body.
        scale: Factor on the size.
        colour: Colour such as "#94a3b8", or "own" for the colour of the file.
        opacity: Opacity, 1 for an opaque object.
        hidden: Whether the object is not drawn. It is checked for contacts nevertheless.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    name: Name
    T: Transform | None = None
    near: tuple[float, float] | None = None
    frame: Frame = Frame.BASE
    shape: Shape | None = None
    size: Annotated[list[float], Meta(min_length=1, max_length=3)] | None = None
    mesh: Key | None = None
    can_be_held: bool | None = None
    zone: Zone | None = None
    scale: Annotated[float, Meta(ge=1e-3, le=1e3)] | None = None
    colour: Annotated[str, Meta(pattern="^(own|#[0-9a-f]{6})$")] | None = None
    opacity: Annotated[float, Meta(ge=0.05, le=1.0)] | None = None
    hidden: bool | None = None


class Load(Request, frozen=True, kw_only=True):
    """Replace all objects and the water by those of an uploaded scene. The arm does not move.

    Attributes:
        scene: Key of the scene, from the answer to its upload.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    scene: Key


class ContinueFrom(MotionRequest, frozen=True, kw_only=True):
    """Let the simulated arm continue from a recorded moment.

    Posture, speed, tool, objects and water are as they were then, and a motion that was under way
    continues to its goal. The server first simulates the recording up to there. A stop or a change
    of driver meanwhile voids the request. Refused are a real arm, and recordings of another robot.

    Attributes:
        t: The moment [s since the epoch].
        of: Name of the recording: "ring" for the last minutes, or that of a file that was opened.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    t: float
    of: Annotated[str, Meta(max_length=40)] = "ring"


class FieldName(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A field of a node of the VRML world.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
    """

    node: NodeName
    field: NodeName


class FieldSetting(FieldName, frozen=True, kw_only=True):
    """A field of a node of the VRML world, and its new value.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        value: New value.
    """

    value: FieldValue


class Set(MotionRequest, frozen=True, kw_only=True):
    """Set fields of the VRML world by the DEF names of their nodes, as VR Sink does.

    If one field cannot be set, none is. The names are those of `katana450 export vrml`; ``query``
    with ``world`` lists them. A ``rotation`` of a joint does not place the joint: it is a command
    to move there, under the rules of ``joints``.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        value: New value.
        more: Further fields to set at the same time.
    """

    traits: ClassVar[Traits] = Traits()

    node: NodeName
    field: NodeName
    value: FieldValue
    more: tuple[FieldSetting, ...] = ()


class Get(Request, frozen=True, kw_only=True):
    """Read fields of the VRML world by the DEF names of their nodes, as VR Source does.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        more: Further fields to read at the same time.
    """

    traits: ClassVar[Traits] = Traits(question=True, answered=True)

    node: NodeName
    field: NodeName
    more: tuple[FieldName, ...] = ()


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
            the branches, the timing of the control loop, the objects, the VRML world, or the
            program with its steps.
    """

    traits: ClassVar[Traits] = Traits(question=True, answered=True)

    at: Literal["state", "arm", "branches", "loop", "objects", "world", "program_plan"] = "state"


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
