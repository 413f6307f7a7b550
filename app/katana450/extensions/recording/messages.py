"""The messages of a recording: their topics, fields and JSON schemas, and those of a state.

Joints are exact. What follows from them is rounded, because digits that nobody needs make most of
a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, Final, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta

from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.modes import JointTarget, PoseTarget
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.extensions.recording.episodes.episode import EpisodeMessage
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.water.flow import VesselWater, Water
from katana450.maths.water.slosh import Slosh
from katana450.maths.water.units import MILLILITRE
from katana450.maths.water.vectors import Vector

COMMANDS: Final = "/commands"
CHECKPOINTS: Final = "/checkpoints"
PLANS: Final = "/plans"
SOLIDS: Final = "/solids"
STATE: Final = "/state"
EVENTS: Final = "/events"
EPISODES: Final = "/episodes"
CAMERAS: Final = "/cameras/"
"""Start of the topic of a camera, before its name."""

SHARED_TOPICS: Final = {"Plan": PLANS, "Solid": SOLIDS}
"""Topic of each class of shared values."""

MAX_COMMANDS = 10_000
"""Maximum number of commands of a tick."""

MAX_TIME = 1e10
"""[s] Greatest time of a message: 300 years fit into the nanoseconds of a log_time."""

Time = Annotated[
    float,
    Meta(
        ge=-MAX_TIME,
        le=MAX_TIME,
        description="time [s] on the clock of the recording, as log_time",
    ),
]
Form = Annotated[Any, Meta(description="exact form of a value; see docs/recording.md")]
Joints = Annotated[list[float], Meta(description="one number for each joint [rad or m]")]
Point = Annotated[tuple[float, float, float], Meta(description="x, y, z in the base frame")]
Quaternion = Annotated[tuple[float, float, float, float], Meta(description="x, y, z, w")]
UPRIGHT: Final = (0.0, 0.0, 1.0)
"""Lean of level water."""

Lean = Annotated[
    tuple[float, float, float], Meta(description="normal of the surface in the base frame")
]


class GivenCommand(msgspec.Struct, forbid_unknown_fields=True):
    """A command and its giver."""

    command: Form
    actor: Form


class SentAnswer(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """The answer of a driver."""

    q: Form
    gripper: Form
    report: Form = None


class TickMessage(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """One tick of the control loop, or the note that some are missing.

    Attributes:
        t: time of the tick [s].
        t_before: time of the state that it steps from [s]; None for that of the tick before.
        commands: its commands as the loop took them, with who gave each.
        sent: the answer of the driver; None if it is the setpoint.
        failed: whether an internal error made the arm hold.
        named: cause of the stop, if a later copy of its press named the presser.
        digest: digest of the state after it.
        missing: why this tick, and ``ticks`` before the next, cannot be simulated.
        ticks: number of missing ticks.
    """

    t: Time
    t_before: Time | None = None
    commands: Annotated[tuple[GivenCommand, ...], Meta(max_length=MAX_COMMANDS)] = ()
    sent: SentAnswer | None = None
    failed: bool = False
    named: Form = None
    digest: str = ""
    missing: str | None = None
    ticks: int = 1


class CheckpointMessage(msgspec.Struct):
    """Complete state after a tick."""

    t: Time
    state: Form


class SharedMessage(msgspec.Struct):
    """A value with its key, a hash of the text of the value, which is kept as it is."""

    key: str
    value: msgspec.Raw


class TargetMessage(msgspec.Struct, omit_defaults=True):
    """Target as given: of the joints, or of the tool in the frame {S} [m, rad]; T is (4, 4)."""

    q: list[float] | None = None
    position: list[float] | None = None
    pitch: float | None = None
    roll: float | None = None
    T: list[list[float]] | None = None


class ObjectPose(msgspec.Struct):
    """Pose of an object, and whether the fingers hold it."""

    name: str
    position: Point
    orientation: Quaternion
    held: bool = False

    @property
    def T(self) -> FloatArray:
        """The pose (4, 4) in the base frame."""
        x, y, z, w = self.orientation
        return se3.from_rotation_translation(so3.from_quaternion((w, x, y, z)), self.position)


class VesselWaterMessage(msgspec.Struct, omit_defaults=True):
    """Volume [ml] and lean of the water in a vessel."""

    name: str
    volume: float
    lean: Lean = UPRIGHT


class WaterMessage(msgspec.Struct, omit_defaults=True):
    """Volumes [ml] in the cup, in the basin, in the air, and spilled.

    ``left`` is what left a vessel in this tick: ml, place [m], velocity [m/s] and time [s].
    """

    cup: float
    basin: float
    air: float
    spilled: float
    lean: Lean = UPRIGHT
    vessels: list[VesselWaterMessage] = []
    left: tuple[float, tuple[float, float, float], tuple[float, float, float], float] | None = None


class StateRow(msgspec.Struct, omit_defaults=True, kw_only=True):
    """A state that changed, for people and programs.

    Numbers that change stand together, so that what stays the same is packed better.

    Attributes:
        t: time of the tick [s].
        q: joints as the driver reported them, unless these are the setpoints [rad or m].
        setpoint: setpoints of the joints [rad or m].
        qd: rates of the setpoints [rad/s or m/s].
        position: the tool point in the base frame [m]; None for a robot without a tool.
        target: the target as given.
        findings: why the goal is not the target, in words.
        gripper, gripper_setpoint: finger joint and its setpoint [rad or m].
        mode, status: mode of the session, and status of the arm.
        speed: fraction of the maximum speed.
        tool: the tool frame.
        objects: objects that were moved, added or taken.
        removed: names of the objects that were removed.
        water: the water; None without a cup.
    """

    t: Time
    q: Joints = []
    setpoint: Joints
    qd: Joints
    position: Point | None = None
    target: TargetMessage
    findings: list[str]
    gripper: float
    gripper_setpoint: float
    mode: str
    status: str
    speed: float
    tool: str = ""
    objects: list[ObjectPose] = []
    removed: list[str] = []
    water: WaterMessage | None = None

    @property
    def joints(self) -> list[float]:
        """The joints where the arm is [rad or m]."""
        return self.q or self.setpoint

    def move_objects(self, objects: dict[str, ObjectPose]) -> None:
        """Apply the changes of this state to the ``objects`` by their names."""
        objects.update({pose.name: pose for pose in self.objects})
        for name in self.removed:
            objects.pop(name, None)


class EventMessage(msgspec.Struct):
    """Something that happened, with further fields by its kind."""

    t: Time
    kind: str


class Topic(NamedTuple):
    """A topic: its name, the name of its schema, and the struct of its messages."""

    name: str
    schema_name: str
    kind: type

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of the messages, which refers to no other part: displays need that."""
        (whole,), parts = msgspec.json.schema_components((self.kind,), ref_template="{name}")
        schema: dict[str, Any] = _without_references(whole, parts)
        return schema


def _without_references(schema: Any, parts: dict[str, Any]) -> Any:
    if isinstance(schema, list):
        return [_without_references(item, parts) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return _without_references(parts[schema["$ref"]], parts)
    return {name: _without_references(item, parts) for name, item in schema.items()}


TOPICS: Final = (
    Topic(COMMANDS, "katana450.Tick", TickMessage),
    Topic(CHECKPOINTS, "katana450.Checkpoint", CheckpointMessage),
    Topic(PLANS, "katana450.Plan", SharedMessage),
    Topic(SOLIDS, "katana450.Solid", SharedMessage),
    Topic(STATE, "katana450.State", StateRow),
    Topic(EVENTS, "katana450.Event", EventMessage),
    Topic(EPISODES, "katana450.Episode", EpisodeMessage),
)
"""All topics of a recording, in the order of their channels."""


DIGITS, SHOWN_DIGITS, RATE_DIGITS = 6, 5, 4
"""Decimals [m, rad, 1] of poses, of what follows from other numbers, and of rates
[rad/s, m/s] and the lean of water."""

NANO = 1_000_000_000

Pose = tuple[Vector, tuple[float, float, float, float]]
"""Position (3,) [m] and unit quaternion x, y, z, w of a frame."""


def nanoseconds(t: float) -> int:
    """Return the log time of ``t`` [s]."""
    return round(t * NANO)


def _rounded(values: FloatArray, digits: int) -> list[float]:
    """Return a few numbers (n,) with ``digits`` decimals; numpy takes longer for them."""
    return [round(value, digits) + 0.0 for value in values.tolist()]


def _point(values: Iterable[float], digits: int) -> Vector:
    x, y, z = (round(float(value), digits) + 0.0 for value in values)
    return x, y, z


def pose_of(T: FloatArray, digits: int = DIGITS) -> Pose:
    """Return the pose ``T`` (4, 4), rounded to ``digits`` decimals."""
    w, x, y, z = so3.to_quaternion(T[:3, :3]).tolist()
    orientation = tuple(round(part, digits) + 0.0 for part in (x, y, z, w))
    return _point(T[:3, 3], digits), orientation


class StateMessages:
    """Makes the messages of the states of one robot, one after another."""

    def __init__(self, robot: Robot, environment: Environment) -> None:
        """Describe states of ``robot``; ``environment`` gives the poses of objects in the hand."""
        self._robot, self._environment = robot, environment
        self._poses: dict[str, ObjectPose] = {}
        self._objects: tuple[SceneObject, ...] | None = None
        self._tools: dict[int, tuple[State, FloatArray]] = {}

    def prepare(self, states: Sequence[State]) -> None:
        """Find the poses of the tool in ``states`` together, which takes less time."""
        arm = self._robot.arm
        if arm is None or len({sample.tool for sample in states}) != 1:
            return
        q = np.array([sample.q for sample in states])
        poses = arm.T_base_shoulder @ forward_batch(arm.chain_to(states[0].tool), q)
        self._tools = {id(state): (state, T) for state, T in zip(states, poses, strict=True)}

    def state(self, state: State) -> StateRow:
        """Return the message of ``state`` on the topic of states."""
        setpoint, T = state.setpoint, self.tool_pose(state)
        same = state.q is setpoint or state.q.tobytes() == setpoint.tobytes()
        objects, removed = self._changed_objects(state)
        return StateRow(
            t=state.t,
            q=[] if same else state.q.tolist(),
            setpoint=setpoint.tolist(),
            qd=_rounded(state.motion.qd, RATE_DIGITS),
            # Its orientation follows from the joints.
            position=None if T is None else _point(T[:3, 3], SHOWN_DIGITS),
            target=_target(state),
            findings=[finding_text(finding) for finding in state.findings],
            gripper=state.gripper,
            gripper_setpoint=state.gripper_setpoint,
            mode=type(state.intent).__name__,
            status=state.status.value,
            speed=state.speed,
            tool="" if T is None else state.tool,
            objects=objects,
            removed=removed,
            water=None if state.poured is None else _water(state.poured.water),
        )

    def tool_pose(self, state: State) -> FloatArray | None:
        """Return the pose (4, 4) of the tool in the base frame; None without a tool."""
        arm = self._robot.arm
        if arm is None:
            return None
        known = self._tools.get(id(state))
        # The state is kept, so that no other can get its identity.
        if known is None or known[0] is not state:
            T = arm.T_base_shoulder @ forward(arm.chain_to(state.tool), state.q)
            known = state, T
            self._tools = {id(state): known}
        return known[1]

    def _changed_objects(self, state: State) -> tuple[list[ObjectPose], list[str]]:
        """Return the objects that have changed, and the names of those that are gone."""
        carried = any(item.carried for item in state.objects)
        if state.objects is self._objects and not carried:
            return [], []
        self._objects = state.objects
        before, self._poses = self._poses, {pose.name: pose for pose in self._object_poses(state)}
        changed = [pose for name, pose in self._poses.items() if before.get(name) != pose]
        return changed, sorted(before.keys() - self._poses.keys())

    def _object_poses(self, state: State) -> Iterator[ObjectPose]:
        for item in state.objects:
            if not item.carried:
                yield ObjectPose(item.name, *pose_of(item.T))
            else:
                # It follows from the joints, and changes in every tick.
                T = self._environment.pose(item, state.x)
                yield ObjectPose(item.name, *pose_of(T, SHOWN_DIGITS), item.held)

    def describe_all(self) -> None:
        """Describe all objects with the next state, also those that have not changed."""
        self._poses, self._objects = {}, None


def _water(water: Water) -> WaterMessage:
    """Return the volumes, the surfaces in the vessels, and the water that left them in this tick.

    Parcels fly freely, so each is described once.
    """
    message = WaterMessage(
        water.cup.volume / MILLILITRE,
        water.basin / MILLILITRE,
        water.air / MILLILITRE,
        water.spilled / MILLILITRE,
        _lean(water.cup),
    )
    message.vessels = [
        VesselWaterMessage(vessel.name, vessel.volume / MILLILITRE, _lean(vessel))
        for vessel in water.others
    ]
    if water.parcels and water.parcels[-1].age == 0.0:
        new = water.parcels[-1]
        start, velocity = _point(new.start, DIGITS), _point(new.velocity, DIGITS)
        message.left = new.volume / MILLILITRE, start, velocity, round(new.span, DIGITS)
    return message


def _lean(water: VesselWater) -> Vector:
    """Return the lean of the surface in a vessel."""
    return UPRIGHT if water.slosh == Slosh() else _point(water.slosh.up, RATE_DIGITS)


def _target(state: State) -> TargetMessage:
    match state.target:
        case JointTarget(q=q):
            return TargetMessage(q=_rounded(q, DIGITS))
        case ToolTarget(position=position, pitch=pitch, roll=roll, is_pitched=True):
            # As in the command, which makes the file smaller.
            return TargetMessage(position=position.tolist(), pitch=pitch, roll=roll)
        case PoseTarget(T=T) | ToolTarget(T=T):
            return TargetMessage(T=[_rounded(row, DIGITS) for row in T])
