"""What the server says: JSON objects whose ``is`` names what they are. Lengths in m, angles in rad,
times in s.
"""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import VERSION, Answer, Numbers
from katana450.server.api.outcome_answers import Done, Finding, PartRefusal, Refused
from katana450.server.api.scene_answers import (
    Field,
    Link,
    Links,
    Mesh,
    Node,
    Objects,
    Scene,
    SceneObject,
    Value,
    Values,
    World,
)

__all__ = [
    "Answer",
    "AnyAnswer",
    "Arm",
    "BranchOption",
    "Branches",
    "Done",
    "Echo",
    "EventLog",
    "Field",
    "Finding",
    "Link",
    "Links",
    "LogLine",
    "Loop",
    "Margins",
    "Mesh",
    "Node",
    "Numbers",
    "Objects",
    "PartRefusal",
    "Progress",
    "Refused",
    "Scene",
    "SceneObject",
    "State",
    "Value",
    "Values",
    "Water",
    "Welcome",
    "World",
    "decoded",
    "encoded",
]


class Welcome(Answer, frozen=True, kw_only=True):
    """The first thing said: who you are here, and what you may do.

    ``name`` is as others see it. ``role``: viewer, operator or admin. ``heartbeat``: heartbeats are
    to come so many seconds apart from whoever holds the arm.
    """

    name: str
    number: int
    role: str
    heartbeat: float
    api: int = VERSION


class Echo(Answer, frozen=True, kw_only=True):
    """To a heartbeat."""

    n: int


class Margins(msgspec.Struct, frozen=True, kw_only=True):
    """How near the arm is to what it cannot pass.

    ``limit``: of the joint that is nearest to one of its limits, how far that is [rad], negative
    beyond it; ``axis``: which joint, counted from 1. ``smallest_singular_value`` [1]: of the
    Jacobian over the arm's own length; 0 in a singularity. ``clearance``: how far the two ``parts``
    that are nearest to each other are apart [m]; both null where nothing is looked at.
    """

    limit: float
    axis: int
    smallest_singular_value: float
    clearance: float | None
    parts: tuple[str, str] | None


class Water(msgspec.Struct, frozen=True, kw_only=True):
    """Where the water is [ml], and how far the cup's lip is above it [m], negative as it flows."""

    cup_ml: float
    basin_ml: float
    air_ml: float
    spilled_ml: float
    margin_to_rim: float


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """The program that is planned or runs, or ran last.

    ``by``: its owner. ``status``: planning, cancelled, refused, ready, running, paused, blocked,
    done, stopped or failed. ``step`` of ``steps`` is under way, on ``line`` of the script, and
    ``fraction`` of its ``task`` is done, or of all planning. ``seconds``: all motions at full
    speed. ``why``: what is wrong with it, or why it was planned anew or not run.
    """

    name: str
    by: str
    status: str
    step: int = 0
    steps: int = 0
    line: int = 0
    task: str = ""
    fraction: float = 0.0
    seconds: float = 0.0
    why: str = ""


class State(Answer, frozen=True, kw_only=True):
    """What the arm does.

    Attributes:
        t: when, on the server's clock, which only goes forwards; an arm at rest is as it was then.
        sent: when this was sent, on the same clock. age: time since the arm's process last
            answered; from 0.3 s on the state counts as unknown.
        ticket: of the last command that is heeded in it. q: (n,) where the arm says it is.
        setpoint, qd: (n,) where it is told to be, and how fast that moves.
        goal: (n,) where it goes, the nearest to what was wished. gripper, gripper_goal: the finger
            joint.
        tool: the frame that ``T`` (4, 4), ``pitch`` and ``roll`` are of; T in the frame {S}.
        tool_speed: of the tool point [m/s], by its setpoints. holding: (n,) torques [N m] that hold
            the arm still there against its own weight, without what it carries; null where its
            description tells no masses.
        margins: how near the arm is to what it cannot pass. touching: the fingers that touch what
            may be held. held: what both hold; null with an empty hand.
        branch: shoulder and elbow. reading: which numbers of a target count.
        Where there are only joints, tool to roll, tool_speed, margins, branch and reading are null;
            see ``arm``.
        status: ok, limited, paused, blocked, gap, stopped or fault. why: in words; else empty.
        speed: fraction of full speed. holder: name of who holds the arm.
        stopped: why nothing moves after a STOP; else null, as is stop: requested, until a state
            newer than the request is stopped, then confirmed.
        revocations: number of stops and of losses of the lease so far.
        windows: pages and programs that are open. water: of the cup; null where there is none.
        program: planned, running or run last. fields: of the VRML world that are watched.
    """

    t: float
    sent: float
    ticket: int
    q: Numbers
    setpoint: Numbers
    qd: Numbers
    goal: Numbers
    gripper: float
    gripper_goal: float
    tool: str | None
    T: list[Numbers] | None
    pitch: float | None
    roll: float | None
    tool_speed: float | None
    holding: Numbers | None
    margins: Margins | None
    touching: list[str]
    held: str | None
    branch: tuple[str, str] | None
    priority: str | None
    status: str
    moving: bool
    why: str
    findings: list[Finding]
    speed: float
    holder: str | None
    stopped: str | None
    stop: str | None
    revocations: int
    age: float
    windows: int
    water: Water | None
    program: Progress | None = None
    fields: tuple[Value, ...] = ()


class Arm(Answer, frozen=True, kw_only=True):
    """What arm it is.

    Attributes:
        joints: their names, in the order of every joint vector.
        lower, upper, speed, acceleration, jerk: (n,) their limits.
        ready: (n,) the posture that Home drives to.
        tools: the tool frames by name, (4, 4) in {S} at the zero posture; default_tool: one.
        gripper: closed and open [rad], and its speed [rad/s]; null without fingers.
        gripper_slides: whether its fingers slide; its numbers are in m and m/s then.
        T_base_shoulder: (4, 4) the frame {S} in the base frame; null where there are only joints.
        slides: (n,) whether each joint slides; its numbers are in m then.
        joints_only: why no tool can be brought to a pose; empty where one can.
    """

    name: str
    joints: list[str]
    lower: Numbers
    upper: Numbers
    speed: Numbers
    acceleration: Numbers
    jerk: Numbers
    ready: Numbers
    tools: dict[str, list[Numbers]]
    default_tool: str | None
    gripper: tuple[float, float, float] | None
    gripper_slides: bool
    T_base_shoulder: list[Numbers] | None
    slides: list[bool]
    joints_only: str


class LogLine(msgspec.Struct, frozen=True, kw_only=True):
    """A reason that began or ended, with the newest command then: whose, which, on what grounds."""

    when: str
    who: str | None
    command: str
    grounds: str | None
    began: bool
    finding: Finding


class EventLog(Answer, frozen=True, kw_only=True):
    """What held the arm back of late, the oldest first."""

    lines: list[LogLine]


class BranchOption(msgspec.Struct, frozen=True, kw_only=True):
    """A branch that could be taken, and what it costs.

    ``position_error``, ``rotation_error``: what it misses the wished pose by. ``distance``: the
    farthest any joint has to go; ``time``: at its full speed. ``contact``: the two parts that would
    meet there.
    """

    shoulder: str
    elbow: str
    q: Numbers
    within_limits: bool
    position_error: float
    rotation_error: float
    distance: float
    time: float
    smallest_singular_value: float
    contact: tuple[str, str] | None


class Branches(Answer, frozen=True, kw_only=True):
    """The ways to stand at the wished pose."""

    choices: list[BranchOption]


class Loop(Answer, frozen=True, kw_only=True):
    """How well the control loop has kept its period of late.

    ``ticks``: how many are looked at; ``late_p50``, ``late_p99``, ``late_max``: how much later
    than due they came; ``lost``: that came more than a period late, since the start.
    """

    period: float
    ticks: int
    late_p50: float
    late_p99: float
    late_max: float
    lost: int


AnyAnswer = (
    Welcome
    | Done
    | Refused
    | Echo
    | State
    | Arm
    | EventLog
    | Branches
    | Loop
    | Objects
    | Values
    | World
    | Links
    | Mesh
    | Scene
)

_decoder: msgspec.json.Decoder[AnyAnswer] = msgspec.json.Decoder(AnyAnswer)


def decoded(text: str | bytes) -> AnyAnswer:
    """The answer that ``text`` is; msgspec.MsgspecError for one that it is not."""
    return _decoder.decode(text)


def encoded(answer: Answer) -> str:
    """As it is sent."""
    return msgspec.json.encode(answer).decode()
