"""The types of values that a recording can hold: those that commands and states are made of.

A value of any other type in a file is refused, so that reading it creates only values of these
types.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, get_args

from katana450.arm.control import commands as cmd
from katana450.arm.control import modes, pouring, scene_objects, solid, state, stop_cause
from katana450.arm.control.actor import Actor, CommandChannel, Grounds
from katana450.arm.control.appearance import (
    Appearance,
    AppearanceTrait,
    DisplayMode,
    LinkAppearance,
)
from katana450.arm.control.arm_commands import ArmAct
from katana450.arm.control.arm_report import ArmMode, ArmReport, MeasuredStop
from katana450.arm.control.following import Following
from katana450.arm.control.lease import Person, Role
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.curve import Curve, Linear, ToolArc, ToolLine
from katana450.extensions.programs.pose_curve import PoseCurve, PoseLines, PoseTurn, TurnedCurve
from katana450.extensions.programs.pose_path import PosePath
from katana450.extensions.programs.tool_curves import Swing, ToolLines, ToolScrew, ToolTurn
from katana450.extensions.programs.tool_path import ToolPath
from katana450.extensions.programs.trajectory_path import TrajectoryPath
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import Fingerprint
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import DragTarget, ToolTarget
from katana450.maths.kinematics.velocity import JogFrame
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.motion.stream import Stream
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.plan import Nearest, Plan, Segment
from katana450.maths.planning.scaling import Scaling
from katana450.maths.water.course import Course
from katana450.maths.water.flow import VesselWater, Water
from katana450.maths.water.parcel import Parcel
from katana450.maths.water.puddle import Puddle
from katana450.maths.water.slosh import Slosh

ENUMS: Final[tuple[type, ...]] = (
    AppearanceTrait,
    ArmAct,
    ArmMode,
    CommandChannel,
    DisplayMode,
    Grounds,
    JogFrame,
    Priority,
    Role,
    scene_objects.Attachment,
    scene_objects.Shape,
    state.Reason,
    state.Verdict,
)
"""Enumerations whose members a recording can hold."""

ROWS: Final[tuple[type, ...]] = (Parcel, Puddle)
"""Named tuples, which are written as rows."""

CLASSES: Final[tuple[type, ...]] = (
    # Commands, and who gave them.
    *get_args(cmd.Command),
    *(Actor, Person, stop_cause.StopCause, Appearance, LinkAppearance),
    # The state and its mode.
    *(state.State, state.ActiveStop, state.Finding, state.Outcome, state.PartRefusal),
    *(modes.Idle, modes.Positioning, modes.Tracking, modes.Jogging, modes.Servoing),
    *(ArmReport, MeasuredStop),
    *(modes.Leaving, modes.JointTarget, modes.PoseTarget, Following, ToolTarget, ToolPose),
    *(JointMotion, Stream, Projection, Branch),
    # Objects and water.
    *(scene_objects.SceneObject, solid.Solid, solid.ObjectAppearance),
    *(pouring.MotionWithWater, pouring.VesselMotion, Water, VesselWater, Slosh, Course),
    # Plans.
    *(Plan, Segment, Scaling, Nearest, Contact, Fingerprint, Chain, JointPath, ToolPath),
    *(TrajectoryPath, PosePath, TurnedCurve, PoseTurn, PoseLines),
    *(ToolLine, ToolLines, ToolArc, ToolScrew, ToolTurn, Linear, Swing),
)
"""Frozen dataclasses that a recording can hold."""

CURVES: Final[Any] = ToolLine | ToolLines | ToolArc | ToolScrew | ToolTurn
PROFILES: Final[Any] = Linear | Swing

MEMBERS: Final[Mapping[Any, Any]] = {
    Path: JointPath | ToolPath | TrajectoryPath | PosePath,
    Curve: CURVES,
    PoseCurve: TurnedCurve | PoseTurn | PoseLines,
    Callable: PROFILES,
    DragTarget: ToolTarget | ToolPose,
}
"""The types that a field may hold whose type is a protocol or a union, by that type."""

SHARED: Final[tuple[type, ...]] = (Plan, solid.Solid)
"""Large values that are written once and then named by a key."""

SINGLE: Final[Mapping[type, Any]] = {modes.Idle: modes.IDLE}
"""Types with one value, which other code compares by identity."""
