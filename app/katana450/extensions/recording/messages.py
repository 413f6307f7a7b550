"""The messages of a recording: their topics, their fields, and the JSON schemas that follow."""

from __future__ import annotations

from typing import Annotated, Any, Final, NamedTuple

import msgspec
from msgspec import Meta

from katana450.extensions.recording.episodes.episode import EpisodeMessage
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

COMMANDS: Final = "/commands"
CHECKPOINTS: Final = "/checkpoints"
PLANS: Final = "/plans"
SOLIDS: Final = "/solids"
STATE: Final = "/state"
JOINT_STATES: Final = "/joint_states"
TF: Final = "/tf"
EVENTS: Final = "/events"
EPISODES: Final = "/episodes"

SHARED_TOPICS: Final = {"Plan": PLANS, "Solid": SOLIDS}
"""Topic of each class of shared values."""

MAX_COMMANDS = 10_000
"""Maximum number of commands of a tick."""

Time = Annotated[float, Meta(description="time [s] on the clock of the recording, as log_time")]
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
        digest: digest of the state after it.
        missing: why this tick, and ``ticks`` before the next, cannot be simulated.
        ticks: number of missing ticks.
    """

    t: Time
    t_before: float | None = None
    commands: Annotated[tuple[GivenCommand, ...], Meta(max_length=MAX_COMMANDS)] = ()
    sent: SentAnswer | None = None
    failed: bool = False
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


class TimeMessage(msgspec.Struct):
    """Time in seconds and nanoseconds."""

    sec: int
    nsec: int


class JointMessage(msgspec.Struct):
    """Position of a joint of the URDF [rad or m]."""

    name: str
    position: float


class JointStatesMessage(msgspec.Struct):
    """Joints of the URDF."""

    timestamp: TimeMessage
    joints: list[JointMessage]


class VectorMessage(msgspec.Struct):
    """Vector [m]."""

    x: float
    y: float
    z: float


class QuaternionMessage(VectorMessage):
    """Unit quaternion."""

    w: float


class TransformMessage(msgspec.Struct):
    """Pose of a frame in its parent."""

    timestamp: TimeMessage
    parent_frame_id: str
    child_frame_id: str
    translation: VectorMessage
    rotation: QuaternionMessage


class TransformsMessage(msgspec.Struct):
    """Frames of the tool and the objects."""

    transforms: list[TransformMessage]


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
        found: dict[str, Any] = _without_references(whole, parts)
        return found


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
    Topic(JOINT_STATES, "foxglove.JointStates", JointStatesMessage),
    Topic(TF, "foxglove.FrameTransforms", TransformsMessage),
    Topic(EVENTS, "katana450.Event", EventMessage),
    Topic(EPISODES, "katana450.Episode", EpisodeMessage),
)
"""All topics of a recording, in the order of their channels."""
