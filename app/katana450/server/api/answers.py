"""Answers of the server: JSON objects whose ``is`` names their kind.

Lengths are in m, angles in rad, times in s.
"""

from __future__ import annotations

from typing import Any

import msgspec

from katana450.server.api.arm_answers import Margins, MeasuredArm, Water
from katana450.server.api.fields import VERSION, Answer, Numbers
from katana450.server.api.outcome_answers import Done, Finding, MotionEnd, PartRefusal, Refused
from katana450.server.api.people_answers import ConnectedPerson, People, PersonConnection
from katana450.server.api.program_answers import Progress
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
    "ConnectedPerson",
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
    "MeasuredArm",
    "Mesh",
    "MotionEnd",
    "Node",
    "Numbers",
    "Objects",
    "PartRefusal",
    "People",
    "PersonConnection",
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
    """The first message on a connection: the client's name, number and role.

    Attributes:
        name: Name that others see.
        number: Number of the client, for ``give`` and ``decline``.
        role: viewer, operator or admin.
        heartbeat: Interval of the heartbeats that the holder of the lease sends [s].
        api: Version of the API.
        stop_port: Port of the same host that serves STOP alone; null if there is none, or if the
            server is behind a proxy.
    """

    name: str
    number: int
    role: str
    heartbeat: float
    api: int = VERSION
    stop_port: int | None = None


class Echo(Answer, frozen=True, kw_only=True):
    """The answer to a heartbeat.

    Attributes:
        n: Number from the heartbeat.
    """

    n: int


class State(Answer, frozen=True, kw_only=True):
    """The state of the arm.

    A mechanism that has only joints has null for ``tool``, ``T``, ``pitch``, ``roll``,
    ``tool_speed``, ``margins``, ``branch`` and ``priority``; see ``arm``.

    Attributes:
        t: Time of the state [s] on the server's monotonic clock. An arm at rest has not changed
            since then.
        sent: Time at which the state was sent [s], on the same clock.
        ticket: Ticket of the last command that the state includes.
        q: (n,) Joint angles that the arm reports [rad]; [m] for joints that slide.
        setpoint: (n,) Joint angles that are sent to the arm.
        qd: (n,) Rates of the setpoint.
        goal: (n,) Posture to which the arm moves, the nearest to the target.
        gripper: Finger joint [rad]; [m] for fingers that slide.
        gripper_goal: Goal of the finger joint.
        tool: Tool frame to which ``T``, ``pitch`` and ``roll`` refer.
        T: (4, 4) Pose of the tool in the frame {S}.
        pitch: Angle of the tool below the horizontal [rad]; null unless the arm has five axes.
        roll: Angle about the tool's own axis [rad]; null unless the arm has five axes.
        tool_speed: Speed of the tool point by its setpoints [m/s].
        holding: (n,) Torques [N m] that hold the arm at rest against its own weight, without a
            load; null where its description states no masses.
        margins: Distances to joint limits, singularity and contact.
        touching: Fingers that touch an object that can be held.
        touch: Forces and pressures of the gripper, see the documentation of touch; null
            for a gripper whose pads are not known.
        held: Object held between both sides of the hand; null with an empty hand.
        branch: Shoulder and elbow; for an arm outside the five-axis family, the words of the name
            of its branch.
        priority: Part of a target that is kept when the arm cannot satisfy all of it.
        status: ok, limited, paused, blocked, gap, stopped or fault.
        moving: Whether the arm moves, or plans a path that it will follow.
        why: Reason for the status in words; empty without one.
        findings: Reasons for which the goal is not the target, or is not approached.
        detour: Duration [s] of the detour that ``go`` moves along; null without an offer.
        speed: Fraction of full speed.
        holder: Name of the holder of the lease; null while the lease is free.
        stopped: Reason for which the arm is stopped; null otherwise.
        stop: requested, then confirmed once a state newer than the request is stopped; null
            without a stop.
        stopped_at: Time of the stop [s since the epoch]; null without one, or if it is not known.
        clearable: Whether the stop can be cleared now: it is confirmed, the arm is at rest, and 1 s
            has passed since the newest STOP. The rights of the client are not included.
        revocations: Number of stops and of losses of the lease so far.
        silence_profile: Reaction of the moving arm to a silent driver or a busy machine: "real arm"
            stops until the stop is cleared; "simulation" pauses until the next command, and stops
            after 5 s of silence.
        age: Time since the arm's process last answered [s]. From 0.3 s the state counts as unknown.
        participants: Number of connected pages and programs.
        water: Water of the cup; null without one.
        arm: Measurement and mode of a real arm; null for a simulated one that follows exactly.
        program: Program that is being planned, is running, or ran last.
        fields: Values of the watched fields of the VRML world.
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
    touch: dict[str, Any] | None
    held: str | None
    branch: tuple[str, ...] | None
    priority: str | None
    status: str
    moving: bool
    why: str
    findings: list[Finding]
    detour: float | None
    speed: float
    holder: str | None
    stopped: str | None
    stop: str | None
    stopped_at: float | None
    clearable: bool
    revocations: int
    silence_profile: str
    age: float
    participants: int
    water: Water | None
    arm: MeasuredArm | None = None
    program: Progress | None = None
    fields: tuple[Value, ...] = ()


class JointLink(msgspec.Struct, frozen=True, kw_only=True):
    """The link that a joint moves.

    Attributes:
        label: Number and name of the joint, for people.
        path: Names of the links from the root to the link.
        axis: (3,) Unit direction of the joint in the frame of the link, whose origin is on it.
    """

    label: str
    path: list[str]
    axis: Numbers


class Arm(Answer, frozen=True, kw_only=True):
    """The description of the arm.

    Numbers of joints that turn are in rad, of joints that slide in m.

    Attributes:
        name: Name of the arm.
        joints: Names of the joints, in the order of every joint vector.
        lower: (n,) Lower limits of the joints.
        upper: (n,) Upper limits of the joints.
        speed: (n,) Maximum speeds [1/s].
        acceleration: (n,) Maximum accelerations [1/s^2].
        jerk: (n,) Maximum jerks [1/s^3].
        ready: (n,) Posture to which ``home`` moves.
        tools: Tool frames by name, (4, 4) in {S} at the zero posture.
        default_tool: Name of the tool frame that is used at first; null without tools.
        gripper: Finger joint closed and open [rad], and its speed [rad/s]; null without fingers.
        gripper_slides: Whether the fingers slide; the numbers of ``gripper`` are in m and m/s then.
        T_base_shoulder: (4, 4) Frame {S} in the base frame; null for a mechanism that has only
            joints.
        slides: (n,) Whether each joint slides.
        links: (n,) The link that each joint moves.
        joints_only: Reason for which no tool can be moved to a pose; empty where one can.
        freedoms: Number of numbers in ``jog`` and ``step_tool``, 5 or 6; 0 without tools.
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
    links: list[JointLink]
    joints_only: str
    freedoms: int = 0


class LogLine(msgspec.Struct, frozen=True, kw_only=True):
    """A finding that began or ended, with the newest command at that time.

    Attributes:
        when: Time in UTC, in ISO 8601.
        who: Name of the participant that gave the command; null for the server itself.
        command: Name of the command.
        grounds: Grounds on which the participant was allowed to give it.
        began: Whether the finding began; otherwise it ended.
        finding: The finding.
    """

    when: str
    who: str | None
    command: str
    grounds: str | None
    began: bool
    finding: Finding


class EventLog(Answer, frozen=True, kw_only=True):
    """Recent findings, the oldest first."""

    lines: list[LogLine]


class BranchOption(msgspec.Struct, frozen=True, kw_only=True):
    """A branch that can be chosen, and its cost.

    Attributes:
        name: Name of the branch.
        shoulder: Shoulder, front or back; null unless the arm has five axes.
        elbow: Elbow, up or down; null unless the arm has five axes.
        q: (n,) Joint angles [rad].
        within_limits: Whether all joints are inside their limits.
        position_error: Distance from the target position [m].
        rotation_error: Angle from the target orientation [rad].
        distance: Maximum angle that a joint has to move [rad].
        time: Minimum duration of the motion, at full speed [s].
        smallest_singular_value: See ``Margins``.
        contact: The two parts that would meet there; null without contact.
        refusal: Why the arm cannot take the branch; empty if it can. If it cannot, the numbers are
            those of the nearest posture on another branch.
    """

    name: str
    shoulder: str | None
    elbow: str | None
    q: Numbers
    within_limits: bool
    position_error: float
    rotation_error: float
    distance: float
    time: float
    smallest_singular_value: float
    contact: tuple[str, str] | None
    refusal: str


class Branches(Answer, frozen=True, kw_only=True):
    """The branches for the target pose."""

    choices: list[BranchOption]


class Loop(Answer, frozen=True, kw_only=True):
    """The recent timing of the control loop.

    Attributes:
        period: Period of the loop [s].
        ticks: Number of ticks that are evaluated.
        late_p50: Median delay of a tick [s].
        late_p99: 99th percentile of the delay [s].
        late_max: Maximum delay [s].
        lost: Number of ticks since the start that came more than a period late.
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
    | People
)

_decoder: msgspec.json.Decoder[AnyAnswer] = msgspec.json.Decoder(AnyAnswer)


def decoded(text: str | bytes) -> AnyAnswer:
    """Return the answer in ``text``. Raises msgspec.MsgspecError if it is invalid."""
    return _decoder.decode(text)


def encoded(answer: Answer) -> str:
    """Return ``answer`` as JSON text."""
    return msgspec.json.encode(answer).decode()
