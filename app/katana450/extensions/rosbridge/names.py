"""Names and types of the topics, services and actions, as they are in ROS 2."""

from __future__ import annotations

from typing import Final

JOINT_STATES: Final = "/joint_states"
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
ROBOT_DESCRIPTION: Final = "/robot_description"
DIAGNOSTICS: Final = "/diagnostics"
STATE: Final = "/katana450/state"

PUBLISHED: Final = {
    JOINT_STATES: "sensor_msgs/msg/JointState",
    TF: "tf2_msgs/msg/TFMessage",
    TF_STATIC: "tf2_msgs/msg/TFMessage",
    ROBOT_DESCRIPTION: "std_msgs/msg/String",
    DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
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
