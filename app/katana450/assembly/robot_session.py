"""The parts of a running app, put together: the arm in one process, what people see in another."""

from __future__ import annotations

import gc
import logging
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from katana450.arm.control.messages import UNCHECKED
from katana450.arm.control.scene_objects import Hand, SceneObject
from katana450.arm.control.session import Session
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.robot.bare import bare
from katana450.arm.robot.collision import hand_of, scene_objects_of, table, world_of
from katana450.arm.robot.initial_scene import InitialScene
from katana450.arm.robot.loader import load
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.water import water_environment
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.link import ArmEnd
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.errors import RobotDescriptionError
from katana450.platform_support import raise_priority
from katana450.settings import Settings

log = logging.getLogger(__name__)


class DescribedRobot(NamedTuple):
    """A robot as its files describe it, the rules for it, and sentences on what they leave open."""

    robot: Robot
    session: Session
    notes: tuple[str, ...]


def describe_robot(settings: Settings, urdf: Path, tool: str | None) -> DescribedRobot:
    """Return the robot with an arm in the file ``urdf``.

    ``tool``: the link its targets are set for; see ``load``. Raises RobotDescriptionError for a
    robot without an arm.
    """
    return arm_session(settings, load(urdf, tool))


def find_robot(settings: Settings, urdf: Path, tool: str | None) -> DescribedRobot:
    """Return the robot in the file ``urdf``: with all its arm can do, or driven joint by joint.

    Raises RobotDescriptionError for a robot that is neither, and for one without an arm where a
    ``tool`` or an arm without gripper was asked for.
    """
    robot = load(urdf, tool)
    try:
        return arm_session(settings, robot)
    except RobotDescriptionError as error:
        if tool is not None or settings.bare:
            raise
        robot = replace(robot, arm=None, why=str(error))
    joints = robot.joint_group
    session = Session(joints, joints.ready, travel=robot.distance)
    notes = (*robot.notes, *robot.joint_notes, f"Joints only. {robot.why}")
    return DescribedRobot(robot, session, notes)


def arm_session(settings: Settings, robot: Robot) -> DescribedRobot:
    """Return ``robot`` with the rules for its arm. Raises RobotDescriptionError without an arm."""
    if settings.bare:
        robot = bare(robot)
    arm = robot.require_arm()
    world, left_out = world_of(robot)
    notes = [*arm.notes, *robot.notes, *left_out]
    props = load_props()
    hand: Hand | None = None
    objects: tuple[SceneObject, ...] = ()
    if world is None:
        notes.append(UNCHECKED)
    else:
        hand, objects = hand_of(robot, world), scene_objects_of(props)
        world = world.with_obstacles((table(),))
    session = Session(
        arm,
        arm.ready(settings.ready),
        world,
        hand=hand,
        objects=objects,
        water_environment=water_environment(props) if objects else None,
    )
    return DescribedRobot(robot, session, tuple(notes))


class RunningArm:
    """A simulated arm and its control loop, and whoever speaks for people at the end of a pipe."""

    def __init__(
        self, settings: Settings, found: DescribedRobot, scene: InitialScene | None = None
    ) -> None:
        """``scene``: what stands around in place of the robot's own, and where the arm stands."""
        robot, session, self.notes = found
        arm = robot.joint_group if robot.arm is None else robot.arm
        start = session.ready if scene is None or scene.joints is None else scene.joints
        driver = SimulatedDriver(arm, start, gripper=0.0)
        self._mailbox = Mailbox(session.check)
        if scene is not None:
            self._mailbox.put(scene.command)
        self._loop = ControlLoop(
            session, driver, self._mailbox, MonotonicClock(), settings.rate, settings.silence
        )
        self._silence = settings.silence
        self._link: ArmEnd | None = None

    def start(self) -> None:
        """Run the control loop in a thread of its own."""
        _be_prompt()
        self._loop.start()

    def attach(self, pipe: Connection) -> None:
        """Obey who is at the other end of ``pipe``, in place of anybody before."""
        if self._link is not None:
            self._link.close()
        self._link = ArmEnd(pipe, self._loop, self._mailbox, self._silence)
        self._link.start()

    @property
    def running(self) -> bool:
        """Whether its control loop runs."""
        return self._loop.running

    @property
    def unheard(self) -> float:
        """[s] Since whoever it obeys was heard of."""
        return 0.0 if self._link is None else self._link.unheard

    def stop(self) -> None:
        """Cut the pipe, and end the loop."""
        if self._link is not None:
            self._link.close()
        self._loop.stop()

    def join(self) -> None:
        """After ``stop``, once the other end of the pipe is gone too: let nothing of it run on."""
        if self._link is not None:
            self._link.join()


def _be_prompt() -> None:
    """Let nothing that can wait come between the ticks."""
    # What is there by now stays: looking through it for garbage takes longer than a tick may be
    # late.
    gc.collect()
    gc.freeze()
    raise_priority()
