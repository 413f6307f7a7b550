"""Messages of ROS 2 as they are in JSON.

Those that clients send are read by the classes below. Fields that a client leaves out are zero, as
in ROS. Those that the server sends are mappings of their fields.

Source: the .msg and .action files of common_interfaces and control_msgs.
"""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
from msgspec import Meta

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
