"""Assembly of the arm's process: the robot, its session and its control loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.robot.arm_reader import OtherArm
from katana450.arm.robot.collision import hand_of, scene_objects_of, table
from katana450.arm.robot.props import load_props, water_environment
from katana450.arm.robot.robot import Robot, bare
from katana450.arm.robot.urdf import Urdf
from katana450.assembly.robot_files import read_robot
from katana450.errors import RobotDescriptionError
from katana450.extension import load
from katana450.maths.collision.world import CollisionWorld
from katana450.settings import Settings

WORLD = "katana450.extensions.bodies.robot_world:robot_world"
"""Function that returns the collision world of a robot, None without shapes, sentences on what it
leaves out, and cautions for its driver."""

HAND = "katana450.extensions.hands.sides:with_sides"
"""Function that completes the hand of an arm in its collision world by its sides."""

OTHER_ARM = "katana450.extensions.general_arms.driven_tool:driven_arm"
"""Function that finds the arm outside the five-axis family in a URDF; see ``FindArm``."""


class DescribedRobot(NamedTuple):
    """A robot as its files describe it, its session, and sentences on what the files lack."""

    robot: Robot
    session: Session
    notes: tuple[str, ...]


def describe_robot(settings: Settings, urdf: Path, tool: str | None) -> DescribedRobot:
    """Return the robot with an arm in the file ``urdf``.

    ``tool``: the link to which targets refer. Raises RobotDescriptionError for a robot without an
    arm.
    """
    return arm_session(settings, read_robot(urdf, tool, find_arm))


def find_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return the arm outside the five-axis family in ``urdf``; None if there is none."""
    arm: OtherArm | None = load(OTHER_ARM)(urdf, path, tool)
    return arm


def find_robot(settings: Settings, urdf: Path, tool: str | None) -> DescribedRobot:
    """Return the robot in the file ``urdf``: with all its arm can do, or driven joint by joint.

    Raises RobotDescriptionError for a robot that is neither. A robot without an arm also raises it
    if a ``tool`` or an arm without gripper is requested.
    """
    robot = read_robot(urdf, tool, find_arm)
    try:
        return arm_session(settings, robot)
    except RobotDescriptionError as error:
        if tool is not None or settings.bare:
            raise
        robot = replace(robot, arm=None, why=str(error))
    joints = robot.joint_group
    robot, world, notes = _with_world(robot)
    session = Session(joints, joints.ready, world, travel=robot.distance)
    return DescribedRobot(robot, session, (*notes, f"Joints only. {robot.why}"))


def arm_session(settings: Settings, robot: Robot) -> DescribedRobot:
    """Return ``robot`` with the session of its arm. Raises RobotDescriptionError without an arm."""
    if settings.bare:
        robot = bare(robot)
    arm = robot.require_arm()
    robot, world, notes = _with_world(robot)
    props = load_props()
    hand: Hand | None = None
    objects: tuple[SceneObject, ...] = ()
    if world is not None:
        hand, objects = load(HAND)(world, hand_of(robot, world)), scene_objects_of(props)
        if hand.gripper != arm.gripper:
            robot = replace(robot, arm=replace(arm, gripper=hand.gripper))
        world = world.with_obstacles((table(),))
    session = Session(
        robot.require_arm(),
        arm.ready(settings.ready),
        world,
        hand=hand,
        objects=objects,
        water_environment=water_environment(props) if objects else None,
    )
    return DescribedRobot(robot, session, (*arm.notes, *notes))


def _with_world(robot: Robot) -> tuple[Robot, CollisionWorld | None, tuple[str, ...]]:
    """Return ``robot`` with its cautions, its world, and notes."""
    world, notes, cautions = load(WORLD)(robot)
    notes = (*robot.notes, *robot.joint_notes, *notes, *cautions)
    return replace(robot, cautions=cautions), world, notes
