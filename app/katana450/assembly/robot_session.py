"""Assembly of the arm's process: the robot, its session and its control loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.scene_objects import Hand, SceneObject
from katana450.arm.control.session import Session
from katana450.arm.robot.arm_reader import FindArm, OtherArm
from katana450.arm.robot.bare import bare
from katana450.arm.robot.cautions import cautions
from katana450.arm.robot.collision import hand_of, scene_objects_of, table, world_of
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.urdf import Urdf
from katana450.arm.robot.water import water_environment
from katana450.assembly.robot_files import read_robot
from katana450.errors import RobotDescriptionError
from katana450.extension import extensions
from katana450.maths.collision.world import CollisionWorld
from katana450.settings import Settings


class DescribedRobot(NamedTuple):
    """A robot as its files describe it, its session, and sentences on what the files lack."""

    robot: Robot
    session: Session
    notes: tuple[str, ...]


def describe_robot(
    settings: Settings, urdf: Path, tool: str | None, find: FindArm | None = None
) -> DescribedRobot:
    """Return the robot with an arm in the file ``urdf``.

    ``tool``: the link to which targets refer. ``find``: see ``load``. Raises RobotDescriptionError
    for a robot without an arm.
    """
    return arm_session(settings, read_robot(urdf, tool, find))


def find_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return the arm outside the five-axis family that an extension finds; None if none does."""
    found = (each.find_arm(urdf, path, tool) for each in extensions() if each.find_arm is not None)
    return next(found, None)


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
    world, left_out = _world(robot)
    session = Session(joints, joints.ready, world, travel=robot.distance)
    robot = replace(robot, cautions=cautions(robot, world, np.append(session.ready, 0.0)))
    notes = (*robot.notes, *robot.joint_notes, *left_out, *robot.cautions)
    return DescribedRobot(robot, session, (*notes, f"Joints only. {robot.why}"))


def arm_session(settings: Settings, robot: Robot) -> DescribedRobot:
    """Return ``robot`` with the session of its arm. Raises RobotDescriptionError without an arm."""
    if settings.bare:
        robot = bare(robot)
    arm = robot.require_arm()
    world, left_out = _world(robot)
    props = load_props()
    hand: Hand | None = None
    objects: tuple[SceneObject, ...] = ()
    if world is not None:
        hand, objects = hand_of(robot, world), scene_objects_of(props)
        for complete in (each.hand for each in extensions() if each.hand is not None):
            hand = complete(world, hand)
        if hand.gripper != arm.gripper:
            robot = replace(robot, arm=replace(arm, gripper=hand.gripper))
        world = world.with_obstacles((table(),))
    ready = arm.ready(settings.ready)
    x = np.append(ready, robot.require_arm().gripper.clamp(0.0))
    robot = replace(robot, cautions=cautions(robot, world, x))
    notes = (*arm.notes, *robot.notes, *robot.joint_notes, *left_out, *robot.cautions)
    session = Session(
        robot.require_arm(),
        ready,
        world,
        hand=hand,
        objects=objects,
        water_environment=water_environment(props) if objects else None,
    )
    return DescribedRobot(robot, session, notes)


def _world(robot: Robot) -> tuple[CollisionWorld | None, tuple[str, ...]]:
    """Return the world that an extension makes, and notes; without one, only arms are checked."""
    make = next((each.world for each in extensions() if each.world is not None), None)
    if make is not None:
        return make(robot)
    return (None, ()) if robot.arm is None else world_of(robot)
