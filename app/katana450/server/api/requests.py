"""Requests to the server: JSON objects of exactly these shapes.

``do`` names the request. A request with an ``id`` is answered; without one only a refusal is
sent. Lengths are in m, angles in rad, times in s. A pose is that of the tool, in the paper's frame
{S} at the shoulder or in the base frame on the table.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Union, get_args

import msgspec
from msgspec import Meta

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import Attachment, Shape
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
    Frame,
    Id,
    MotionRequest,
    Name,
    Request,
    RequestTraits,
    tag_of,
)
from katana450.server.api.lease_requests import (
    Acquire,
    Ask,
    Decline,
    Give,
    ReleaseLease,
    Rename,
    Take,
    Withdraw,
)
from katana450.server.api.motion_requests import (
    Branch,
    EndDrag,
    Go,
    GoToZero,
    Gripper,
    Hold,
    Home,
    Jog,
    Joint,
    Joints,
    OperateArm,
    Orient,
    Pose,
    Position,
    Redo,
    Servo,
    StepTool,
    Turn,
    Undo,
)
from katana450.server.api.people_requests import Kick, ListPeople
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
from katana450.server.api.stop_requests import Hello, Stop

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
    "Go",
    "GoToZero",
    "Gripper",
    "Heartbeat",
    "Hello",
    "Hold",
    "Home",
    "Jog",
    "Joint",
    "Joints",
    "Kick",
    "ListPeople",
    "Load",
    "MotionRequest",
    "Nudge",
    "OperateArm",
    "Orient",
    "Pause",
    "Place",
    "Pose",
    "Position",
    "Query",
    "Redo",
    "ReleaseLease",
    "Remove",
    "Rename",
    "Request",
    "RequestDecoder",
    "Resume",
    "Servo",
    "Set",
    "SetPriority",
    "Shape",
    "Speed",
    "StepTool",
    "Stop",
    "Take",
    "Tool",
    "Turn",
    "Undo",
    "Watch",
    "Withdraw",
    "id_of",
]


class Heartbeat(Request, frozen=True, kw_only=True):
    """A heartbeat. The holder of the lease sends ten a second.

    Otherwise a moving arm stops, or pauses if it is simulated.

    Attributes:
        n: Number that the answer repeats, for measuring the round trip.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(free=True, answered=True)

    n: int = 0


class ClearStop(Request, frozen=True):
    """Clear a stop: the arm accepts motion again. Nothing moves, and old targets are dropped."""

    traits: ClassVar[RequestTraits] = RequestTraits(free=True)

    def command(self) -> cmd.Command:
        return cmd.ClearStop()


class Speed(Request, frozen=True, kw_only=True):
    """Set the maximum speed.

    Attributes:
        value: Fraction of full speed.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(for_program=True)

    value: Annotated[float, Meta(ge=MIN_SPEED, le=MAX_SPEED)]

    def command(self) -> cmd.Command:
        return cmd.SpeedScale(self.value)


class Tool(Request, frozen=True, kw_only=True):
    """Choose the tool frame to which targets and read-outs refer. Nothing moves.

    Attributes:
        name: Name of the tool frame; the answer ``arm`` lists them.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name

    def command(self) -> cmd.Command:
        return cmd.SetTool(self.name)


class SetPriority(Request, frozen=True, kw_only=True):
    """Choose which part of a target is kept when the arm cannot satisfy all of it.

    Attributes:
        priority: The part that is kept first.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    priority: Priority

    def command(self) -> cmd.Command:
        return cmd.SetPriority(self.priority)


class Nudge(MotionRequest, frozen=True, kw_only=True):
    """Move one joint by a relative angle, counted from its goal.

    The new goal is limited to the range of the joint.

    Attributes:
        axis: Number of the joint, counted from 1.
        by: Change of the goal [rad]; [m] for a joint that slides.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    axis: Annotated[int, Meta(ge=1, le=MAX_JOINTS)]
    by: float

    def command(self) -> cmd.Command:
        return cmd.Nudge(self.axis - 1, self.by)


class Pause(Request, frozen=True):
    """Come to rest on the path and keep the target.

    The requests ``pause``, ``resume`` and ``speed`` also act on a running program. Only its owner
    may send them then: the page or API program that started it. A program that is being planned
    starts paused.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(for_program=True)

    def command(self) -> cmd.Command:
        return cmd.Pause()


class Resume(MotionRequest, frozen=True):
    """Resume the motion after a pause."""

    traits: ClassVar[RequestTraits] = RequestTraits(for_program=True)

    def command(self) -> cmd.Command:
        return cmd.Resume()


class Watch(Request, frozen=True, kw_only=True):
    """Send the state periodically from now on. A slow connection gets fewer states.

    When a stop begins, is confirmed or is cleared, the state is sent at once.

    Attributes:
        hz: Number of states per second; 0 ends the stream.
        fields: Fields of the VRML world whose values each state includes.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(question=True)

    hz: Annotated[float, Meta(ge=0.0, le=MAX_STATES_PER_SECOND)]
    fields: tuple[FieldName, ...] = ()


class Query(Request, frozen=True, kw_only=True):
    """Send one answer now.

    Attributes:
        at: Subject of the answer, which has the same name: the state, the description of the arm,
            the event log, the branches, the timing of the control loop, the objects, the VRML
            world, or the poses of the links.
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
    | StepTool
    | Speed
    | Joint
    | Joints
    | Nudge
    | Servo
    | Pose
    | Position
    | Turn
    | Orient
    | Gripper
    | Tool
    | SetPriority
    | Branch
    | EndDrag
    | Go
    | Home
    | GoToZero
    | Hold
    | OperateArm
    | Pause
    | Resume
    | Set
    | Get
    | Watch
    | Query
    | Rename
)
"""The requests that every server answers. Extensions answer more."""


class _Named(msgspec.Struct):
    id: Id = None
    do: Any = None


_names = msgspec.json.Decoder(_Named)


class RequestDecoder:
    """Decoder of the requests that a server answers, of the classes ``kinds``."""

    def __init__(self, added: tuple[type[Request], ...] = ()) -> None:
        """Accept the requests of AnyRequest, and those of the classes ``added`` by extensions."""
        kinds: Any = Union[(AnyRequest, *added)]
        self.kinds: tuple[type[Request], ...] = get_args(kinds)
        self._decoder: msgspec.json.Decoder[Request] = msgspec.json.Decoder(kinds)
        self._known = {tag_of(kind.__name__) for kind in self.kinds}

    def decoded(self, text: str | bytes) -> Request:
        """Return the request in ``text``. Raises InputError with the reason if it is invalid."""
        if len(text) > MAX_REQUEST_BYTES:
            raise InputError(f"A request has at most {MAX_REQUEST_BYTES} bytes.")
        try:
            return self._decoder.decode(text)
        except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
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
