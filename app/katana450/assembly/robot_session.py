"""Assembly of the arm's process: the robot, its session and its control loop."""

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
from katana450.arm.runtime.stop_end import StopEnd
from katana450.errors import RobotDescriptionError
from katana450.platform_support import raise_priority
from katana450.settings import Settings

log = logging.getLogger(__name__)


class DescribedRobot(NamedTuple):
    """A robot as its files describe it, its session, and sentences on what the files lack."""

    robot: Robot
    session: Session
    notes: tuple[str, ...]


def describe_robot(settings: Settings, urdf: Path, tool: str | None) -> DescribedRobot:
    """Return the robot with an arm in the file ``urdf``.

    ``tool``: the link to which targets refer; see ``load``. Raises RobotDescriptionError for a
    robot without an arm.
    """
    return arm_session(settings, load(urdf, tool))


def find_robot(settings: Settings, urdf: Path, tool: str | None) -> DescribedRobot:
    """Return the robot in the file ``urdf``: with all its arm can do, or driven joint by joint.

    Raises RobotDescriptionError for a robot that is neither. A robot without an arm also raises it
    if a ``tool`` or an arm without gripper is requested.
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
    """Return ``robot`` with the session of its arm. Raises RobotDescriptionError without an arm."""
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
    """A simulated arm with its control loop, driven by the front end at the end of a pipe."""

    def __init__(
        self, settings: Settings, found: DescribedRobot, scene: InitialScene | None = None
    ) -> None:
        """Prepare the arm; it does not run yet.

        ``scene``: scene in place of the robot's own, and initial joint angles.
        """
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
        self._silence_timeout = settings.silence
        self._link: ArmEnd | None = None
        self._stop_end: StopEnd | None = None

    def start(self) -> None:
        """Run the control loop in a separate thread."""
        _be_prompt()
        self._loop.start()

    def attach(self, pipe: Connection) -> None:
        """Execute the commands from the other end of ``pipe``, in place of any previous pipe."""
        if self._link is not None:
            self._link.close()
        self._link = ArmEnd(pipe, self._loop, self._mailbox, self._silence_timeout)
        self._link.start()

    def attach_stop(self, pipe: Connection) -> None:
        """Execute each STOP from the other end of ``pipe``, in place of any previous pipe."""
        if self._stop_end is not None:
            self._stop_end.close()
        self._stop_end = StopEnd(pipe, self._loop, self._mailbox)
        self._stop_end.start()

    @property
    def running(self) -> bool:
        """True while the control loop runs."""
        return self._loop.running

    @property
    def silence(self) -> float:
        """[s] Time since the last message of the front end."""
        return 0.0 if self._link is None else self._link.silence

    def stop(self) -> None:
        """Close the pipe, and end the loop."""
        for end in (self._link, self._stop_end):
            if end is not None:
                end.close()
        self._loop.stop()

    def join(self) -> None:
        """Wait for the threads of the links; call it after ``stop``, when the others ended."""
        for end in (self._link, self._stop_end):
            if end is not None:
                end.join()


def _be_prompt() -> None:
    """Keep garbage collection and other processes from delaying the ticks."""
    # Exempt all present objects from garbage collection, which would delay a tick too much.
    gc.collect()
    gc.freeze()
    raise_priority()
