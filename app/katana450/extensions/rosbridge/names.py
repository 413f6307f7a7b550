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
    **{
        f"/rosapi/{name}": f"rosapi_msgs/srv/{kind}"
        for name, kind in {
            "topics": "Topics",
            "topics_for_type": "TopicsForType",
            "topic_type": "TopicType",
            "services": "Services",
            "services_for_type": "ServicesForType",
            "service_type": "ServiceType",
            "action_servers": "GetActionServers",
            "nodes": "Nodes",
            "get_param": "GetParam",
            "get_time": "GetTime",
        }.items()
    },
}
"""Services that clients can call."""


def resolved(name: str) -> str:
    """Return ``name`` in the root, where relative names of a client without a namespace are."""
    return name if name.startswith("/") else f"/{name}"


def is_type(kind: str, known: str) -> bool:
    """Return whether ``kind`` names the type ``known``; the middle part is left out in ROS 1."""
    package, _, name = known.split("/")
    return kind in (known, f"{package}/{name}")
