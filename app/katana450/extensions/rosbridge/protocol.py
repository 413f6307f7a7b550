"""The protocol rosbridge v2: names and types, operations, and the messages of ROS 2 in JSON.

Messages that clients send are read by classes. Fields that a client leaves out are zero, as in ROS.
Those that the server sends are mappings of their fields.

Source: ROSBRIDGE_PROTOCOL.md of rosbridge_suite; the .msg and .action files of common_interfaces
and control_msgs.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, TypeVar, get_args

import msgspec
from msgspec import Meta

from katana450.arm.control.commands.act import Traits, tag_of
from katana450.errors import InputError

JOINT_STATES: Final = "/joint_states"
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
ROBOT_DESCRIPTION: Final = "/robot_description"
STATE: Final = "/katana450/state"

PUBLISHED: Final = {
    JOINT_STATES: "sensor_msgs/msg/JointState",
    TF: "tf2_msgs/msg/TFMessage",
    TF_STATIC: "tf2_msgs/msg/TFMessage",
    ROBOT_DESCRIPTION: "std_msgs/msg/String",
    STATE: "std_msgs/msg/String",
}
"""Topics that clients can subscribe to."""

TWIST: Final = "/servo_node/delta_twist_cmds"
JOINT_JOG: Final = "/servo_node/delta_joint_cmds"

COMMANDED: Final = {
    TWIST: "geometry_msgs/msg/TwistStamped",
    JOINT_JOG: "control_msgs/msg/JointJog",
}
"""Topics to which clients can publish: those of MoveIt Servo."""

TOPICS: Final = PUBLISHED | COMMANDED

STOP_SERVICE: Final = "/stop"
HOLD_SERVICE: Final = "/hold"
CLEAR_SERVICE: Final = "/clear_stop"
TRIGGER: Final = "std_srvs/srv/Trigger"

FOLLOW: Final = "/arm_controller/follow_joint_trajectory"
GRIPPER: Final = "/gripper_controller/gripper_cmd"

ACTIONS: Final = {
    FOLLOW: "control_msgs/action/FollowJointTrajectory",
    GRIPPER: "control_msgs/action/GripperCommand",
}
"""Actions. The controllers have the names of those in an exported package for ROS 2."""

CANCEL: Final = "/_action/cancel_goal"
"""End of the name of the service that cancels the goal of an action."""

SERVICES: Final = {
    STOP_SERVICE: TRIGGER,
    HOLD_SERVICE: TRIGGER,
    CLEAR_SERVICE: TRIGGER,
    **{action + CANCEL: "action_msgs/srv/CancelGoal" for action in ACTIONS},
    "/rosapi/topics": "rosapi_msgs/srv/Topics",
    "/rosapi/services": "rosapi_msgs/srv/Services",
    "/rosapi/action_servers": "rosapi_msgs/srv/GetActionServers",
}
"""Services that clients can call."""

LISTS: Final = {
    "/rosapi/topics": {"topics": list(TOPICS), "types": list(TOPICS.values())},
    "/rosapi/services": {"services": list(SERVICES)},
    "/rosapi/action_servers": {"action_servers": list(ACTIONS)},
}
"""Answers of the services that list what there is. Their arguments have no effect."""


def resolved(name: str) -> str:
    """Return ``name`` in the root, where relative names of a client without a namespace are."""
    return name if name.startswith("/") else f"/{name}"


def is_type(kind: str, known: str) -> bool:
    """Return whether ``kind`` names the type ``known``; the middle part is left out in ROS 1."""
    package, _, name = known.split("/")
    return kind in (known, f"{package}/{name}")


MAX_OP_BYTES = 327_680
"""Maximum size of an operation [bytes]: a long trajectory with rates and accelerations."""

MAX_THROTTLE = 3_600_000
"""Maximum interval of a topic [ms]."""

MAX_PROBLEM_LENGTH = 300
"""Maximum number of characters of the problem that a refusal repeats."""

OpId = Annotated[int, Meta(ge=-(2**53), le=2**53)] | Annotated[str, Meta(max_length=256)] | None
Name = Annotated[str, Meta(min_length=1, max_length=200)]
Type = Annotated[str, Meta(max_length=200)]

T = TypeVar("T", bound=msgspec.Struct)

FREE, STOP = Traits(free=True), Traits(free=True, safety=True)

NOTHING = msgspec.Raw(b"{}")


class Op(msgspec.Struct, frozen=True, kw_only=True, tag_field="op", tag=tag_of):
    """Base of all operations. Fields that the server does not use are ignored, as in rosbridge.

    Attributes:
        id: Number or text of the client's own, repeated in answers.
    """

    id: OpId = None

    @property
    def traits(self) -> Traits:
        """The traits of the operation: ``safety`` for the rate limit, ``free`` for the budget."""
        return Traits()


class Advertise(Op, frozen=True, kw_only=True):
    """Announce messages of a topic."""

    topic: Name
    type: Type


class Unadvertise(Op, frozen=True, kw_only=True):
    """End the announcement of a topic."""

    topic: Name


class Publish(Op, frozen=True, kw_only=True):
    """Send a message of a topic."""

    topic: Name
    msg: msgspec.Raw = NOTHING


class Subscribe(Op, frozen=True, kw_only=True):
    """Receive the newest message of a topic, at most each ``throttle_rate`` [ms].

    ``queue_length`` has no effect: older messages are dropped in any case.
    """

    topic: Name
    type: Type | None = None
    throttle_rate: Annotated[float, Meta(ge=0, le=MAX_THROTTLE)] = 0.0
    queue_length: int = 0
    fragment_size: int | None = None
    compression: str | None = None


class Unsubscribe(Op, frozen=True, kw_only=True):
    """End a subscription, or all of a topic if it has no ``id``."""

    topic: Name


class CallService(Op, frozen=True, kw_only=True):
    """Call a service."""

    service: Name
    args: msgspec.Raw = NOTHING

    @property
    def traits(self) -> Traits:
        """The traits of the service: what ends a motion or a stop costs nothing."""
        if (name := resolved(self.service)) == STOP_SERVICE:
            return STOP
        return FREE if name in (HOLD_SERVICE, CLEAR_SERVICE) or name.endswith(CANCEL) else Traits()


class SendActionGoal(Op, frozen=True, kw_only=True):
    """Send a goal to an action. ``feedback``: whether its progress is sent."""

    action: Name
    action_type: Type = ""
    args: msgspec.Raw = NOTHING
    feedback: bool = False


class CancelActionGoal(Op, frozen=True, kw_only=True):
    """Cancel the goal that was sent with this ``id``."""

    action: Name

    @property
    def traits(self) -> Traits:
        """The traits: a cancel costs nothing."""
        return FREE


AnyOp = (
    Advertise
    | Unadvertise
    | Publish
    | Subscribe
    | Unsubscribe
    | CallService
    | SendActionGoal
    | CancelActionGoal
)

_decoder: msgspec.json.Decoder[AnyOp] = msgspec.json.Decoder(AnyOp)
_known = {tag_of(kind.__name__) for kind in get_args(AnyOp)}


class _Named(msgspec.Struct):
    id: OpId = None
    op: Any = None


_names = msgspec.json.Decoder(_Named)


def decoded(text: str | bytes) -> AnyOp:
    """Return the operation in ``text``. Raises InputError with the reason if it is invalid."""
    if len(text) > MAX_OP_BYTES:
        raise InputError(f"A message has at most {MAX_OP_BYTES // 1024} KB.")
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        name = _named(text).op
        if isinstance(name, str) and name not in _known:
            known = ", ".join(sorted(_known))
            raise InputError(f"This server has no op {name[:40]!r}. It has {known}.") from error
        raise InputError(f"This is not a valid message of rosbridge: {problem(error)}") from error


def id_of(text: str | bytes) -> OpId:
    """Return the id in ``text``, which need not be a valid operation; None without one."""
    return _named(text[:MAX_OP_BYTES]).id


def _named(text: str | bytes) -> _Named:
    try:
        return _names.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return _Named()


def problem(error: Exception) -> str:
    """Return what ``error`` says is wrong, as a sentence of bounded length."""
    return f"{str(error)[:MAX_PROBLEM_LENGTH].rstrip('.')}."


def read(raw: msgspec.Raw, kind: type[T], what: str) -> T:
    """Return ``raw`` as a message of ``kind``; ``what`` names it in the refusal.

    Raises InputError for wrong, unknown and missing fields, and for numbers that are not finite.
    """
    try:
        return msgspec.json.decode(raw, type=kind)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise InputError(f"This is not {what}: {problem(error)}") from error


NANOSECONDS = 1_000_000_000

Seconds = Annotated[int, Meta(ge=-(2**31), le=2**32 - 1)]
Nanoseconds = Annotated[int, Meta(ge=0, lt=NANOSECONDS)]
Names = Annotated[list[Annotated[str, Meta(max_length=200)]], Meta(max_length=64)]
Numbers = Annotated[list[float], Meta(max_length=64)]


Fields = dict[str, Any]
"""A message that the server sends."""


class RosMessage(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the messages that clients send."""


class Time(RosMessage, frozen=True, kw_only=True):
    """builtin_interfaces/Time or Duration."""

    sec: Seconds = 0
    nanosec: Nanoseconds = 0

    @property
    def seconds(self) -> float:
        """The time [s]."""
        return self.sec + self.nanosec / NANOSECONDS


class Header(RosMessage, frozen=True, kw_only=True):
    """std_msgs/Header."""

    stamp: Time = Time()
    frame_id: Annotated[str, Meta(max_length=200)] = ""


class Vector3(RosMessage, frozen=True, kw_only=True):
    """geometry_msgs/Vector3."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Twist(RosMessage, frozen=True, kw_only=True):
    """geometry_msgs/Twist."""

    linear: Vector3 = Vector3()
    angular: Vector3 = Vector3()


class TwistStamped(RosMessage, frozen=True, kw_only=True):
    """geometry_msgs/TwistStamped."""

    header: Header = Header()
    twist: Twist = Twist()


class JointJog(RosMessage, frozen=True, kw_only=True):
    """control_msgs/JointJog."""

    header: Header = Header()
    joint_names: Names = []
    displacements: Numbers = []
    velocities: Numbers = []
    duration: float = 0.0


class JointTrajectoryPoint(RosMessage, frozen=True, kw_only=True):
    """trajectory_msgs/JointTrajectoryPoint."""

    positions: Numbers = []
    velocities: Numbers = []
    accelerations: Numbers = []
    effort: Numbers = []
    time_from_start: Time = Time()


class JointTrajectory(RosMessage, frozen=True, kw_only=True):
    """trajectory_msgs/JointTrajectory."""

    header: Header = Header()
    joint_names: Names = []
    points: list[JointTrajectoryPoint] = []


class MultiDOFJointTrajectory(RosMessage, frozen=True, kw_only=True):
    """trajectory_msgs/MultiDOFJointTrajectory, which is accepted only if it is empty."""

    header: Header = Header()
    joint_names: Annotated[list[str], Meta(max_length=0)] = []
    points: Annotated[list[float], Meta(max_length=0)] = []


NoTolerances = Annotated[list[float], Meta(max_length=0)]


class FollowJointTrajectory(RosMessage, frozen=True, kw_only=True):
    """The goal of control_msgs/FollowJointTrajectory. Tolerances of joints must be empty."""

    trajectory: JointTrajectory = JointTrajectory()
    multi_dof_trajectory: MultiDOFJointTrajectory = MultiDOFJointTrajectory()
    path_tolerance: NoTolerances = []
    component_path_tolerance: NoTolerances = []
    goal_tolerance: NoTolerances = []
    component_goal_tolerance: NoTolerances = []
    goal_time_tolerance: Time = Time()


class GripperPosition(RosMessage, frozen=True, kw_only=True):
    """control_msgs/GripperCommand, the message."""

    position: float = 0.0
    max_effort: float = 0.0


class GripperCommand(RosMessage, frozen=True, kw_only=True):
    """The goal of the action control_msgs/GripperCommand."""

    command: GripperPosition = GripperPosition()


class NoArguments(RosMessage, frozen=True, kw_only=True):
    """The request of std_srvs/Trigger."""


def time_of(seconds: float) -> Time:
    """Return ``seconds`` [s] as a time of ROS 2, rounded to 1 ns."""
    sec, nanosec = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)
