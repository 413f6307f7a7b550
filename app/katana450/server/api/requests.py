"""What may be asked of the server: JSON objects of exactly these shapes.

``do`` names the request. One with an ``id`` is answered; without one only a refusal is told.
Lengths in m, angles in rad, times in s. A pose is of the tool, in the paper's frame {S} at the
shoulder or in the base frame on the table.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Union, get_args

import msgspec
from msgspec import Meta

from katana450.errors import InputError
from katana450.maths.kinematics.priority import Priority
from katana450.server.api.fields import (
    COMMAND,
    MAX_JOINTS,
    MAX_REQUEST_BYTES,
    MAX_SPEED,
    MAX_STATES_PER_SECOND,
    MIN_SPEED,
    ROOT,
    VERSION,
    Attachment,
    Frame,
    Id,
    Name,
    Press,
    Request,
    RequestTraits,
    Shape,
    tag_of,
)
from katana450.server.api.lease_requests import (
    Acquire,
    Ask,
    Decline,
    Give,
    ReleaseLease,
    Take,
    Withdraw,
)
from katana450.server.api.motion_requests import (
    EndDrag,
    GoToZero,
    Gripper,
    Home,
    Jog,
    Joint,
    Joints,
    Pose,
    Position,
    Servo,
    Turn,
)
from katana450.server.api.scene_requests import (
    Attach,
    FieldName,
    FieldSetting,
    Fill,
    Get,
    Load,
    Place,
    Remove,
    Set,
)

__all__ = [
    "MAX_REQUEST_BYTES",
    "VERSION",
    "Acquire",
    "AnyRequest",
    "Ask",
    "Attach",
    "Attachment",
    "Branch",
    "ClearStop",
    "Decline",
    "EndDrag",
    "FieldName",
    "FieldSetting",
    "Fill",
    "Frame",
    "Get",
    "Give",
    "GoToZero",
    "Gripper",
    "Heartbeat",
    "Hello",
    "Hold",
    "Home",
    "Jog",
    "Joint",
    "Joints",
    "Load",
    "Nudge",
    "Pause",
    "Place",
    "Pose",
    "Position",
    "Query",
    "ReleaseLease",
    "Remove",
    "Request",
    "RequestDecoder",
    "Resume",
    "Servo",
    "Set",
    "SetPriority",
    "Shape",
    "Speed",
    "Stop",
    "Take",
    "Tool",
    "Turn",
    "Watch",
    "Withdraw",
    "id_of",
]


class Hello(Request, frozen=True, kw_only=True):
    """The first line on the TCP port: who speaks, and a link's token where one is asked for."""

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name
    token: Annotated[str, Meta(max_length=400)] = ""


class Heartbeat(Request, frozen=True, kw_only=True):
    """A heartbeat; the number comes back, which gives the round trip.

    Whoever holds the arm gives ten a second. Without them a moving arm is stopped.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(free=True, answered=True)

    n: int = 0


class Stop(Request, frozen=True, kw_only=True):
    """STOP: the arm comes to rest as fast as it can. Everybody may, at any time.

    Who says it again, for want of an answer, gives the same ``press``: it counts once, so that a
    late one does not undo the ``clear_stop`` that came in between.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(free=True, safety=True)

    press: Press = None


class ClearStop(Request, frozen=True):
    """Accept motion again after a stop. Nothing moves by it; old targets are gone."""

    traits: ClassVar[RequestTraits] = RequestTraits(free=True)


class Speed(Request, frozen=True, kw_only=True):
    """How fast the arm is at most, as a fraction of full speed."""

    traits: ClassVar[RequestTraits] = RequestTraits(for_program=True)

    value: Annotated[float, Meta(ge=MIN_SPEED, le=MAX_SPEED)]


class Tool(Request, frozen=True, kw_only=True):
    """From now on targets and read-outs are of this tool frame. Nothing moves."""

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name


class SetPriority(Request, frozen=True, kw_only=True):
    """From now on this says which numbers of a target count when not all can be had."""

    traits: ClassVar[RequestTraits] = COMMAND

    priority: Priority


class Branch(Request, frozen=True, kw_only=True):
    """Go to the wished pose with another shoulder or elbow."""

    traits: ClassVar[RequestTraits] = COMMAND

    shoulder: Literal["front", "back"]
    elbow: Literal["up", "down"]


class Nudge(Request, frozen=True, kw_only=True):
    """Drive one joint on by a relative angle; ``axis`` counts from 1. What slides moves by m.

    The angle counts from where the joint is going. Beyond the joint's range it is limited.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    axis: Annotated[int, Meta(ge=1, le=MAX_JOINTS)]
    by: float


class Hold(Request, frozen=True):
    """Come to rest and forget the target."""

    traits: ClassVar[RequestTraits] = COMMAND


class Pause(Request, frozen=True):
    """Come to rest on the way, and keep the target.

    Pause, resume and speed also act on a program that runs, for its owner alone: the page or API
    program that started it. A program that is planned meanwhile starts paused.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(for_program=True)


class Resume(Request, frozen=True):
    """Go on."""

    traits: ClassVar[RequestTraits] = RequestTraits(for_program=True)


class Watch(Request, frozen=True, kw_only=True):
    """Tell the state so many times a second, from now on; 0 ends it. A slow line is told less.

    ``fields``: of the VRML world, whose values each state is to bring.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(question=True)

    hz: Annotated[float, Meta(ge=0.0, le=MAX_STATES_PER_SECOND)]
    fields: tuple[FieldName, ...] = ()


class Query(Request, frozen=True, kw_only=True):
    """Tell something once: the state, what arm it is, what held it back, its branches, the loop,
    the objects around it, the VRML world, where its links are.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(question=True, answered=True)

    at: Literal["state", "arm", "event_log", "branches", "loop", "objects", "world", "links"] = (
        "state"
    )


AnyRequest = (
    Hello
    | Heartbeat
    | Stop
    | ClearStop
    | Acquire
    | Take
    | Ask
    | Withdraw
    | ReleaseLease
    | Give
    | Decline
    | Jog
    | Speed
    | Joint
    | Joints
    | Nudge
    | Servo
    | Pose
    | Position
    | Turn
    | Gripper
    | Tool
    | SetPriority
    | Branch
    | EndDrag
    | Home
    | GoToZero
    | Hold
    | Pause
    | Resume
    | Place
    | Attach
    | Load
    | Remove
    | Fill
    | Set
    | Get
    | Watch
    | Query
)


class _Named(msgspec.Struct):
    id: Id = None
    do: Any = None


_names = msgspec.json.Decoder(_Named)


class RequestDecoder:
    """Decodes the requests of the core, and those that an extension adds."""

    def __init__(self, added: tuple[type[Request], ...] = ()) -> None:
        """``added``: classes of an extension."""
        kinds: Any = Union[(AnyRequest, *added)]
        self._decoder: msgspec.json.Decoder[Request] = msgspec.json.Decoder(kinds)
        self._known = {tag_of(kind.__name__) for kind in get_args(kinds)}

    def decoded(self, text: str | bytes) -> Request:
        """Return the request in ``text``. Raises InputError with the reason where it holds none."""
        if len(text) > MAX_REQUEST_BYTES:
            raise InputError(f"A request has at most {MAX_REQUEST_BYTES} bytes.")
        try:
            return self._decoder.decode(text)
        except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
            name = _named(text).do
            if isinstance(name, str) and name not in self._known:
                raise InputError(
                    f"This server has no request {name!r}. {ROOT}/openapi.json lists those it has."
                ) from error
            raise InputError(f"That is no request: {error}.") from error


def id_of(text: str | bytes) -> Id:
    """The id in ``text``, which may be no request otherwise."""
    return _named(text[:MAX_REQUEST_BYTES]).id


def _named(text: str | bytes) -> _Named:
    """Return id and name in ``text``, without those that it does not have."""
    try:
        return _names.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return _Named()
