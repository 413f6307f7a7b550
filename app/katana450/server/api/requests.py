"""What may be asked of the server: JSON objects of exactly these shapes.

``do`` names the request. One with an ``id`` is answered; without one only a refusal is told.
Lengths in m, angles in rad, times in s. A pose is of the tool, in the paper's frame {S} at the
shoulder or in the base frame on the table.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from katana450.errors import InputError
from katana450.maths.kinematics.reading import Reading
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api.fields import (
    FASTEST,
    FASTEST_ANGULAR,
    FASTEST_LINEAR,
    LARGEST,
    LEAST_SHARE,
    MOST_JOINTS,
    MOST_STATES,
    SLOWEST,
    VERSION,
    Form,
    Frame,
    Id,
    Matrix4,
    Mount,
    Name,
    Order,
    Press,
    Rates,
    Request,
    Vector3,
)
from katana450.server.api.scene_requests import (
    Attach,
    Fill,
    Get,
    Load,
    Named,
    Place,
    Remove,
    Set,
    Setting,
)

__all__ = [
    "LARGEST",
    "VERSION",
    "Acquire",
    "AnyRequest",
    "Ask",
    "Attach",
    "Branch",
    "ClearStop",
    "EndDrag",
    "Fill",
    "Form",
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
    "Mount",
    "Named",
    "Order",
    "Pause",
    "Place",
    "Pose",
    "Position",
    "Program",
    "Query",
    "Read",
    "ReleaseLease",
    "Remove",
    "Request",
    "Resume",
    "Servo",
    "Set",
    "Setting",
    "Speed",
    "Steer",
    "Stop",
    "Take",
    "Tool",
    "Turn",
    "Watch",
    "Withdraw",
    "decoded",
    "id_of",
]


class Hello(Request, frozen=True, kw_only=True):
    """The first line on the TCP port: who speaks, and a link's token where one is asked for."""

    name: Name
    token: Annotated[str, Meta(max_length=400)] = ""


class Heartbeat(Request, frozen=True, kw_only=True):
    """A heartbeat; the number comes back, which gives the round trip.

    Whoever holds the arm gives ten a second. Without them a moving arm is stopped.
    """

    n: int = 0


class Stop(Request, frozen=True, kw_only=True):
    """STOP: the arm comes to rest as fast as it can. Everybody may, at any time.

    Who says it again, for want of an answer, gives the same ``press``: it counts once, so that a
    late one does not undo the ``clear_stop`` that came in between.
    """

    press: Press = None


class ClearStop(Request, frozen=True):
    """Accept motion again after a stop. Nothing moves by it; old targets are gone."""


class Acquire(Request, frozen=True):
    """Have the arm if nobody has it. A command by whoever holds nothing asks for this by itself."""


class Take(Request, frozen=True):
    """Have it even so: for admins."""


class Ask(Request, frozen=True):
    """Ask whoever has it."""


class Withdraw(Request, frozen=True):
    """Ask no more."""


class ReleaseLease(Request, frozen=True):
    """Give up the arm, so that others can have it."""


class Give(Request, frozen=True, kw_only=True):
    """Give it to the window or program of that number."""

    to: int


class Jog(Request, frozen=True, kw_only=True):
    """Move for 0.2 s: (x, y, z) [m/s], pitch and roll [rad/s], along the axes of a frame.

    To be said again while the motion shall last.
    """

    rates: Rates
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        limits = (FASTEST_LINEAR,) * 3 + (FASTEST_ANGULAR,) * 2
        for rate, limit in zip(self.rates, limits, strict=True):
            if not math.isfinite(rate) or abs(rate) > limit:
                raise ValueError(f"{rate} is no rate between {-limit:g} and {limit:g}")


class Speed(Request, frozen=True, kw_only=True):
    """How fast the arm is at most, as a share of full speed."""

    value: Annotated[float, Meta(ge=SLOWEST, le=FASTEST)]


class Joint(Request, frozen=True, kw_only=True):
    """Drive one joint; ``axis`` counts from 1. What slides is told in m."""

    axis: Annotated[int, Meta(ge=1, le=MOST_JOINTS)]
    value: float


class Joints(Request, frozen=True, kw_only=True):
    """Drive all joints to ``q``; they arrive together, on a straight line in joint space."""

    q: Annotated[list[float], Meta(min_length=1, max_length=MOST_JOINTS)]


class Servo(Request, frozen=True, kw_only=True):
    """One of a stream of joint angles, followed under the limits of speed, acceleration and jerk.

    ``qd`` says how fast they change; without it that is seen from the stream, less exactly. When no
    other comes for 0.2 s the arm comes to rest.
    """

    q: Annotated[list[float], Meta(min_length=1, max_length=MOST_JOINTS)]
    qd: Annotated[list[float], Meta(min_length=1, max_length=MOST_JOINTS)] | None = None


class Pose(Request, frozen=True, kw_only=True):
    """Bring the tool to a pose, as near as five axes can; what gives way is the ``reading``'s."""

    T: Matrix4
    frame: Frame = Frame.SHOULDER


class Position(Request, frozen=True, kw_only=True):
    """Bring the tool point somewhere; pitch and roll stay as wished."""

    p: Vector3
    frame: Frame = Frame.SHOULDER


class Turn(Request, frozen=True, kw_only=True):
    """Give the tool a pitch (positive downwards) and a roll; its point stays as wished."""

    pitch: float
    roll: float


class Gripper(Request, frozen=True, kw_only=True):
    """Drive the finger joint; the arm's description says between which angles."""

    angle: float


class Tool(Request, frozen=True, kw_only=True):
    """From now on targets and read-outs are of this tool frame. Nothing moves."""

    name: Name


class Read(Request, frozen=True, kw_only=True):
    """From now on this says which numbers of a target count when not all can be had."""

    reading: Reading


class Branch(Request, frozen=True, kw_only=True):
    """Go to the wished pose with another shoulder or elbow."""

    shoulder: Literal["front", "back"]
    elbow: Literal["up", "down"]


class EndDrag(Request, frozen=True):
    """End a drag: the nearest pose that the arm can reach becomes the target."""


class Home(Request, frozen=True):
    """Drive to the ready posture."""


class GoToZero(Request, frozen=True):
    """Drive to the zero posture, the arm stretched along x."""


class Hold(Request, frozen=True):
    """Come to rest and forget the target."""


class Pause(Request, frozen=True):
    """Come to rest on the way, and keep the target.

    Pause, resume and speed also act on a program that runs, for its owner alone: the page or API
    program that started it. A program that is planned meanwhile starts paused.
    """


class Resume(Request, frozen=True):
    """Go on."""


class Program(Request, frozen=True, kw_only=True):
    """A part of a script, of docs/programs.md; after the last one it is planned.

    All but the last say ``more``. ``speed``: share of the script's own. The state tells how far the
    planning is, when it is done, or what is wrong with the script, line by line. The last plan is
    kept: the same script is ready at once while posture, gripper, tool, scene and water are the
    same.
    """

    text: Annotated[str, Meta(max_length=LARGEST)]
    more: bool = False
    speed: Annotated[float, Meta(ge=LEAST_SHARE, le=1.0)] = 1.0


class Steer(Request, frozen=True, kw_only=True):
    """Run, step, pause, resume or end the program that is planned.

    It drives by itself, under its own name; its owner has to stay connected. While it is being
    planned, ``run`` and ``step`` take effect afterwards, unless the arm is told to move, hold or
    stop in between; ``pause`` makes it start paused, and ``end`` cancels the planning. A program
    that is to run from another posture or scene than it was planned for is planned anew first. An
    arm that is paused when a program begins stays paused until ``resume``.
    """

    order: Order


class Watch(Request, frozen=True, kw_only=True):
    """Tell the state so many times a second, from now on; 0 ends it. A slow line is told less.

    ``fields``: of the VRML world, whose values each state is to bring.
    """

    hz: Annotated[float, Meta(ge=0.0, le=MOST_STATES)]
    fields: tuple[Named, ...] = ()


class Query(Request, frozen=True, kw_only=True):
    """Tell something once: the state, what arm it is, what held it back, its branches, the loop,
    the things around it, the VRML world, where its links are."""

    at: Literal["state", "arm", "ledger", "branches", "loop", "things", "world", "links"] = "state"


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
    | Jog
    | Speed
    | Joint
    | Joints
    | Servo
    | Pose
    | Position
    | Turn
    | Gripper
    | Tool
    | Read
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
    | Program
    | Steer
    | Watch
    | Query
)

_decoder: msgspec.json.Decoder[AnyRequest] = msgspec.json.Decoder(AnyRequest)


class _Named(msgspec.Struct):
    id: Id = None


_names = msgspec.json.Decoder(_Named)


def decoded(text: str | bytes) -> AnyRequest:
    """The request that ``text`` is. Raises InputError for one that it is not."""
    if len(text) > LARGEST:
        raise InputError(f"A request has at most {LARGEST} bytes.")
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise InputError(f"That is no request: {error}.") from error


def id_of(text: str | bytes) -> Id:
    """The id in ``text``, which may be no request otherwise."""
    try:
        return _names.decode(text[:LARGEST]).id
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return None
