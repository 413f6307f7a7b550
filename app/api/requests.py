"""What may be asked of the server: JSON objects of exactly these shapes.

``do`` names the request. One with an ``id`` is answered; without one only a refusal is told.
Lengths in m, angles in rad, times in s. A pose is of the tool, in the paper's frame {S} at the
shoulder or in the base frame on the table.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from app.errors import InputError
from app.kinematics.reading import Reading
from app.kinematics.velocity import JogFrame

VERSION = 1

LARGEST = 1024
"""Bytes of a request."""

FASTEST_LINEAR = 0.5
"""[m/s] More than the arm can do; anything beyond is nobody's wish."""

FASTEST_ANGULAR = 3.0
"""[rad/s] Likewise."""

SLOWEST, FASTEST = 0.05, 1.0
"""Share of full speed."""

LEAST_SHARE = 0.01
"""Of its own speed that a program can be run at."""

MOST_STATES = 100
"""States a second that one can be told: as many as there are."""

MOST_JOINTS = 32

Rates = tuple[float, float, float, float, float]
"""Velocity of the tool point (x, y, z) [m/s], rates of pitch and roll [rad/s]."""

Vector3 = tuple[float, float, float]
Row = tuple[float, float, float, float]
Matrix4 = tuple[Row, Row, Row, Row]

Id = Annotated[int, Meta(ge=0, le=2**53 - 1)] | Annotated[str, Meta(max_length=64)] | None
LONGEST_PRESS = 64
"""Characters that tell one press of STOP from another."""

Press = Annotated[str, Meta(min_length=1, max_length=LONGEST_PRESS)] | None
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


class Form(Enum):
    """What a thing counts as where contacts are looked for."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    MESH = "mesh"
    """A file that was uploaded; it counts as its convex hull."""


class Mount(Enum):
    """What a thing can be fixed to."""

    HAND = "hand"
    """It goes with the hand, whatever the fingers do, and counts as a part of it."""
    WORLD = "world"
    """It stays where it is."""
    TABLE = "table"
    """Likewise, once it is put down upright on the table below."""


class Request(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="do",
    tag=str.lower,
):
    """Any of them; ``do`` is the name of the class in small letters."""

    id: Id = None


class Hello(Request, frozen=True, kw_only=True):
    """The first line on the TCP port: who speaks, and a link's token where one is asked for."""

    name: Name
    token: Annotated[str, Meta(max_length=400)] = ""


class Beat(Request, frozen=True, kw_only=True):
    """A sign of life; the number comes back, which gives the round trip.

    Whoever holds the arm gives ten a second. Without them a moving arm is stopped.
    """

    n: int = 0


class Stop(Request, frozen=True, kw_only=True):
    """STOP: the arm comes to rest as fast as it can. Everybody may, at any time.

    Who says it again, for want of an answer, gives the same ``press``: it counts once, so that a
    late one does not undo the reset that came in between.
    """

    press: Press = None


class Reset(Request, frozen=True):
    """End a stop. Nothing moves by it; old targets are gone."""


class Acquire(Request, frozen=True):
    """Have the arm if nobody has it. A command by whoever holds nothing asks for this by itself."""


class Take(Request, frozen=True):
    """Have it even so: for admins."""


class Ask(Request, frozen=True):
    """Ask whoever has it."""


class Withdraw(Request, frozen=True):
    """Ask no more."""


class Release(Request, frozen=True):
    """Give it up."""


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


class Settle(Request, frozen=True):
    """What the arm can do becomes what is wished."""


class Home(Request, frozen=True):
    """Drive to the ready posture."""


class Stretch(Request, frozen=True):
    """Drive to the zero posture, the arm stretched along x."""


class Hold(Request, frozen=True):
    """Come to rest and forget the target."""


class Pause(Request, frozen=True):
    """Come to rest on the way, and keep the target."""


class Resume(Request, frozen=True):
    """Go on."""


class Place(Request, frozen=True, kw_only=True):
    """Put a thing somewhere: a new one, or one that is there, of which what is not given stays.

    ``form`` and ``size`` [m] are what it counts as where contacts are looked for: box (x, y, z),
    cylinder (radius, height) or sphere (radius); of a mesh ``mesh`` is its key, as the upload told
    it, and the size is the file's. Its frame is in the middle of its underside. A new thing without
    ``T`` stands in front of the arm where there is room. ``can_be_held``: the fingers may touch it,
    and hold it when both do. ``colour``: as "#94a3b8", or "own" for that of the file. ``hidden``:
    it is not drawn, and counts for contacts even so.
    """

    name: Name
    T: Matrix4 | None = None
    frame: Frame = Frame.BASE
    form: Form | None = None
    size: Annotated[list[float], Meta(min_length=1, max_length=3)] | None = None
    mesh: Key | None = None
    can_be_held: bool | None = None
    scale: Annotated[float, Meta(ge=1e-3, le=1e3)] | None = None
    colour: Annotated[str, Meta(pattern="^(own|#[0-9a-f]{6})$")] | None = None
    opacity: Annotated[float, Meta(ge=0.05, le=1.0)] | None = None
    hidden: bool | None = None


class Attach(Request, frozen=True, kw_only=True):
    """Fix a thing to the hand, as a camera or another tool, or to the world again.

    ``T``: where on the hand, in the frame of the arm's default tool; without it, it stays where it
    is.
    """

    name: Name
    to: Mount
    T: Matrix4 | None = None


class Load(Request, frozen=True, kw_only=True):
    """Have the things of a scene that was uploaded, in place of all there are, and its water.

    The arm stays where it is.
    """

    scene: Key


class Remove(Request, frozen=True, kw_only=True):
    """Take a thing away."""

    name: Name


class Fill(Request, frozen=True, kw_only=True):
    """Fill the cup with so many ml of water, and wipe up what is elsewhere."""

    ml: Annotated[float, Meta(ge=0.0, le=1000.0)]


class Named(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A field of a node of the VRML world, by its DEF name."""

    node: NodeName
    field: NodeName


class Setting(Named, frozen=True, kw_only=True):
    """What such a field is to be; null for how it is made."""

    value: FieldValue


class Set(Request, frozen=True, kw_only=True):
    """Set a field of the VRML world by the DEF name of its node, as VR Sink does; ``more`` at once.

    Either all are set or, where one cannot be, none. The names are those of `katana450 export
    vrml`; ``look`` at ``world`` lists them. A joint is never put anywhere: its ``rotation`` is an
    order to go there, by the rules of ``joints``. ``value`` null: a colour, a transparency or a
    choice as it is made.
    """

    node: NodeName
    field: NodeName
    value: FieldValue
    more: tuple[Setting, ...] = ()


class Get(Request, frozen=True, kw_only=True):
    """Tell what a field of the VRML world is now, as VR Source does, and ``more`` of them."""

    node: NodeName
    field: NodeName
    more: tuple[Named, ...] = ()


class Order(Enum):
    """What a program can be told."""

    RUN = "run"
    STEP = "step"
    """Run one step, then wait."""
    PAUSE = "pause"
    RESUME = "resume"
    HALT = "halt"
    """Come to rest and end it."""


class Program(Request, frozen=True, kw_only=True):
    """A part of a script, of docs/programs.md; after the last one it is planned.

    All but the last say ``more``. ``speed``: share of the script's own. The state tells when it is
    planned, or what is wrong with it, line by line.
    """

    text: Annotated[str, Meta(max_length=LARGEST)]
    more: bool = False
    speed: Annotated[float, Meta(ge=LEAST_SHARE, le=1.0)] = 1.0


class Steer(Request, frozen=True, kw_only=True):
    """Run, step, pause, resume or halt the program that is planned.

    It drives by itself, under its own name; whoever started it stays connected.
    """

    order: Order


class Watch(Request, frozen=True, kw_only=True):
    """Tell the state so many times a second, from now on; 0 ends it. A slow line is told less.

    ``fields``: of the VRML world, whose values each state is to bring.
    """

    hz: Annotated[float, Meta(ge=0.0, le=MOST_STATES)]
    fields: tuple[Named, ...] = ()


class Look(Request, frozen=True, kw_only=True):
    """Tell something once: the state, what arm it is, what held it back, its branches, the loop,
    the things around it, the VRML world, where its links are."""

    at: Literal["state", "arm", "ledger", "branches", "loop", "things", "world", "links"] = "state"


AnyRequest = (
    Hello
    | Beat
    | Stop
    | Reset
    | Acquire
    | Take
    | Ask
    | Withdraw
    | Release
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
    | Settle
    | Home
    | Stretch
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
    | Look
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
