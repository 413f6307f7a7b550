"""Answers of the server: JSON objects whose ``is`` names their kind.

Lengths are in m, angles in rad, times in s.
"""

from __future__ import annotations

from typing import Any, Union

import msgspec

from katana450.server.api.fields import VERSION
from katana450.server.api.fields import Answer as Answer
from katana450.server.api.fields import Numbers as Numbers
from katana450.server.api.outcome_answers import *
from katana450.server.api.outcome_answers import Finding
from katana450.server.api.scene_answers import *
from katana450.server.api.scene_answers import Value


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


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """The program that is being planned, is running, or ran last.

    Attributes:
        name: Name of the program.
        by: Name of its owner.
        status: planning, cancelled, refused, ready, running, paused, blocked, done, stopped or
            failed.
        step: Number of the present step.
        steps: Number of steps.
        line: Line of the present step in the script.
        task: Present task in words.
        fraction: Fraction of the task that is done, or of all planning.
        seconds: Expected duration of the run if its conditions hold as planned [s].
        seconds_left: Expected time until the run ends [s], on the same clock; 0 if none runs.
        why: What is wrong with the program, why it was planned again or not run, or which times of
            the script it does not keep.
        skipped: Numbers of the steps with nothing to do, and of alternatives not taken.
        breakpoints: Numbers of the steps before which it pauses.
        can_continue: Whether it was interrupted, and nothing has changed that prevents continue.
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
    seconds_left: float = 0.0
    why: str = ""
    skipped: tuple[int, ...] = ()
    breakpoints: tuple[int, ...] = ()
    can_continue: bool = False


class ProgramStep(msgspec.Struct, frozen=True, kw_only=True):
    """A step of a planned program.

    Attributes:
        name: Its name.
        seconds: Its expected duration [s]; 0 if it is not expected to run.
        mark: done, now, next, ended here or skipped while the program runs and afterwards; before
            that, shown for the step at the time that is looked at; "" for all others.
        predicted: Whether it is executed if all is as predicted.
        line: Line of the text at which it begins, from 1.
        column: Column there, from 1.
    """

    name: str
    seconds: float
    mark: str = ""
    predicted: bool = True
    line: int = 1
    column: int = 1


class ProgramPlan(Answer, frozen=True, kw_only=True):
    """The program that was sent last, with its steps once it is planned.

    Attributes:
        text: Its script; "" before the first one.
        program: Its progress, as in the state; null before the first one.
        steps: Its steps in their order, with those of all alternatives.
        seconds: Duration of its preview [s]; 0 while there is none.
        look: Time of the preview that the scene shows [s]; 0 for none, and None if it is hidden.
    """

    text: str = ""
    program: Progress | None = None
    steps: tuple[ProgramStep, ...] = ()
    seconds: float = 0.0
    look: float | None = 0.0


class Margins(msgspec.Struct, frozen=True, kw_only=True):
    """Distances to joint limits, singularity and contact.

    Attributes:
        limit: Distance of the turning joint nearest to one of its limits from that limit [rad];
            negative beyond it.
        axis: Number of that joint, counted from 1.
        limits: (n,) Distance of each joint from its nearer limit [rad], or [m] for a joint that
            slides; negative beyond it.
        smallest_singular_value: Smallest singular value of the Jacobian over the characteristic
            length of the arm [1]; 0 in a singularity.
        clearance: Distance of the two nearest parts [m]; null where contacts are not checked.
        parts: The two nearest parts; null where contacts are not checked.
    """

    limit: float
    axis: int
    limits: Numbers
    smallest_singular_value: float
    clearance: float | None
    parts: tuple[str, str] | None


class Water(msgspec.Struct, frozen=True, kw_only=True):
    """Water by its place.

    Attributes:
        cup_ml: Volume in the cup [ml].
        basin_ml: Volume in the basin [ml].
        air_ml: Volume in free flight [ml].
        spilled_ml: Volume elsewhere [ml].
        vessels_ml: Volume in each other vessel by its name [ml].
        margin_to_rim: Height of the lip of the vessel in the hand, or of the cup, above its water
            [m]; negative while water flows out.
    """

    cup_ml: float
    basin_ml: float
    air_ml: float
    spilled_ml: float
    vessels_ml: dict[str, float]
    margin_to_rim: float


class MeasuredArm(msgspec.Struct, frozen=True, kw_only=True):
    """Measurements and mode of an arm that a driver reports. ``q`` of the state is measured too.

    Attributes:
        mode: disconnected, connected, uncalibrated, calibrating, holding, moving, collided, fault
            or lost.
        note: Sentence about the mode; empty if there is nothing to say.
        acts: Acts that are possible now, see ``operate_arm``.
        t: Time of the measurement [s], on the clock of the state.
        expected: (n + 1,) Joints and finger joint where the arm should have been then [rad].
        speeds: (n + 1,) Measured speeds [rad/s]; null if they are not measured.
        round_trip: Time of the newest exchange with the arm [s].
        stop_time: Time to rest of the newest stop, as measured [s]; null before the first.
        stop_angle: Maximum angle of a joint in it [rad]; null before the first.
        stop_distance: Travel of the tool in it [m]; null before the first, and if it is not known.
        sensors: Raw values of the sensors of the gripper; empty without sensors.
    """

    mode: str
    note: str
    acts: list[str]
    t: float
    expected: Numbers
    speeds: Numbers | None
    round_trip: float
    stop_time: float | None
    stop_angle: float | None
    stop_distance: float | None
    sensors: list[float]


class FingerForce(msgspec.Struct, frozen=True, kw_only=True):
    """The force of a finger on objects.

    Attributes:
        finger: Name of the finger among the parts of the arm; of a single jaw, also the part of the
            palm against which it closes.
        force: Sum of the normal forces of its contacts [N].
    """

    finger: str
    force: float


class Touch(msgspec.Struct, frozen=True, kw_only=True):
    """The forces between the fingers and objects, as the physics simulates them.

    Attributes:
        preload: How much farther than the held object the fingers are commanded to close [rad]; [m]
            for fingers that slide, 0 with an empty hand.
        force_limit: Greatest force of the fingers on one side of an object [N]. Assumed.
        fingers: Force of each finger that can press on an object, in the same order in all states.
    """

    preload: float
    force_limit: float
    fingers: list[FingerForce]


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
        touch: Forces of the fingers; null for a hand that cannot hold objects.
        held: Object held between both sides of the hand; null with an empty hand.
        branch: Shoulder and elbow; for an arm outside the five-axis family, the words of the name
            of its branch.
        priority: Part of a target that is kept when the arm cannot satisfy all of it.
        status: ok, limited, paused, blocked, gap, stopped or fault.
        moving: Whether the arm moves, or plans a path that it will follow.
        why: Reason for the status in words, and until the next command the reason for which no
            path was found; empty without one.
        findings: Reasons for which the goal is not the target, or is not approached.
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
    touch: Touch | None
    held: str | None
    branch: tuple[str, ...] | None
    priority: str | None
    status: str
    moving: bool
    why: str
    findings: list[Finding]
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
        suction_cup: Whether the gripper is a suction cup, which is on unless it is open.
        T_base_shoulder: (4, 4) Frame {S} in the base frame; null for a mechanism that has only
            joints.
        slides: (n,) Whether each joint slides.
        links: (n,) The link that each joint moves.
        joints_only: Reason for which no tool can be moved to a pose; empty where one can.
        freedoms: Number of numbers in ``jog`` and ``step_tool``, 5 or 6; 0 without tools.
        turns_elbow: Whether ``turn_elbow``, and the seventh rate of a ``jog``, move the elbow.
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
    suction_cup: bool
    T_base_shoulder: list[Numbers] | None
    slides: list[bool]
    links: list[JointLink]
    joints_only: str
    freedoms: int = 0
    turns_elbow: bool = False


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


EVERY: tuple[type[Answer], ...] = tuple(
    kind
    for kind in globals().values()
    if isinstance(kind, type) and issubclass(kind, Answer) and kind is not Answer
)
"""The classes of all answers."""

_KINDS: Any = Union[EVERY]  # noqa: UP007
_decoder: msgspec.json.Decoder[Answer] = msgspec.json.Decoder(_KINDS)


def decoded(text: str | bytes) -> Answer:
    """Return the answer in ``text``. Raises msgspec.MsgspecError if it is invalid."""
    return _decoder.decode(text)


def encoded(answer: Answer) -> str:
    """Return ``answer`` as JSON text."""
    return msgspec.json.encode(answer).decode()
