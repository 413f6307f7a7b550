"""The arm's process: the control loop, and the address at which other processes reach it."""

from __future__ import annotations

import gc
import logging
import os
import pickle
import shutil
import sys
import threading
import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from multiprocessing.connection import Connection

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.stopping import SilenceProfile, at_rest, restarted
from katana450.arm.control.state.state import State
from katana450.arm.drivers.driver import Driver, SimulatedDriver
from katana450.arm.robot.object_meshes import InitialScene, Meshes
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.pipes.arm_end import ArmEnd
from katana450.arm.runtime.pipes.arm_roles import FRONT, RECORD, STOP
from katana450.arm.runtime.pipes.private_listener import Greeting, PrivateListener, Roles
from katana450.arm.runtime.pipes.state_publisher import StatePublisher
from katana450.arm.runtime.pipes.stop_end import StopEnd
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.assembly.supervised import KEPT, READY, SCENE, SupervisorPipe
from katana450.extension import ServerFacts, TickSender, results
from katana450.maths.geometry.arrays import FloatArray
from katana450.platform_support import raise_priority
from katana450.settings import Settings

WAKE_INTERVAL = 0.2
"""[s] Interval at which the end of the control loop is checked."""

KEEP_INTERVAL = 0.02
"""[s] Minimum time between two states that the supervisor keeps."""

IDLE_INTERVAL = 5.0
"""[s] Maximum time for which the thread that keeps states sleeps; a new state wakes it."""

BRAKING_TIMEOUT = 2.0
"""[s] Timeout for a moving arm to come to rest before its process ends."""

log = logging.getLogger(__name__)


class RunningArm:
    """An arm with its control loop, for the other processes at the ends of pipes."""

    def __init__(
        self,
        settings: Settings,
        described: DescribedRobot,
        scene: InitialScene | None = None,
        *,
        again: bool = False,
        last: State | None = None,
        make_driver: Callable[[Robot, FloatArray, float], Driver | None] = lambda *_: None,
    ) -> None:
        """Prepare the arm; it does not run yet.

        Args:
            settings: settings of the server.
            described: the robot.
            scene: scene in place of the robot's own, and initial joint angles.
            again: whether the arm ran before in another process. It then begins stopped.
            last: last known state of that process, where the arm and its objects begin.
            make_driver: returns the driver; None for that of the ideal simulation. Raises
                KatanaError.
        """
        robot, session, self.notes = described
        arm = robot.joint_group if robot.arm is None else robot.arm
        q, gripper = session.ready, 0.0
        if last is not None:
            q, gripper = last.q, last.gripper
        elif scene is not None and scene.joints is not None:
            q = scene.joints
        driver = make_driver(robot, q, gripper) or SimulatedDriver(arm, q, gripper)
        strict = settings.strict_silence
        self._mailbox = Mailbox(session.check)
        if scene is not None:
            self._mailbox.put(scene.command)
        self._loop = ControlLoop(
            session,
            driver,
            self._mailbox,
            MonotonicClock(),
            settings.rate,
            settings.silence,
            partial(restarted, last_state=last) if again else None,
            SilenceProfile.REAL_ARM if strict else driver.silence_profile,
        )
        self._silence_timeout = settings.silence
        self._front_end: ArmEnd | None = None
        self._stop_end: StopEnd | None = None
        self._tick_sender: TickSender | None = None
        self._attaching = threading.Lock()
        self._proven = -1

    def start(self) -> None:
        """Run the control loop in a separate thread."""
        raise_priority()
        self._loop.start()

    def attach(self, pipe: Connection, greeting: Greeting) -> None:
        """Execute the commands from the other end of ``pipe``, in place of any previous pipe."""
        with self._attaching:
            if self._front_end is not None:
                self._front_end.close()
            self._front_end = ArmEnd(
                pipe, self._loop, self._mailbox, self._silence_timeout, greeting.number
            )
            self._front_end.start()

    def attach_stop(self, pipe: Connection, _greeting: Greeting) -> None:
        """Execute each STOP from the other end of ``pipe``, in place of any previous pipe."""
        with self._attaching:
            if self._stop_end is not None:
                self._stop_end.close()
            self._stop_end = StopEnd(pipe, self._loop, self._mailbox)
            self._stop_end.start()

    def record(self, sender: TickSender) -> None:
        """Give the record of each further tick to ``sender``."""
        self._tick_sender, self._loop.record = sender, sender.put

    @property
    def state_publisher(self) -> StatePublisher:
        """Publisher of the states of the arm."""
        return self._loop.state_publisher

    @property
    def running(self) -> bool:
        """True while the control loop runs."""
        return self._loop.running

    def ticks_again(self) -> bool:
        """Return whether the control loop has ticked since the last call."""
        ticks = self._loop.ticks
        proven, self._proven = self._proven, ticks
        return ticks != proven

    def stop(self) -> None:
        """Brake to rest, end the loop, and close the pipes."""
        ends = [pipe_end for pipe_end in (self._front_end, self._stop_end) if pipe_end is not None]
        for pipe_end in ends:
            pipe_end.close()
        # Even at rest: a command that has just arrived may begin a motion.
        self._mailbox.put(cmd.Stop())
        end = time.monotonic() + BRAKING_TIMEOUT
        while not self._stands_stopped() and self.running and time.monotonic() < end:
            time.sleep(0.01)
        self._loop.stop()
        if self._tick_sender is not None:
            # Last, so that the brake is recorded too.
            self._tick_sender.close()
        for pipe_end in ends:
            pipe_end.join()
        # Let Python collect reference cycles when it ends.
        gc.unfreeze()

    def _stands_stopped(self) -> bool:
        state = self.state_publisher.snapshot.state
        return state.stopped is not None and not state.moving


def run_arm(
    config: ServerFacts, content: dict[bytes, bytes] | None, supervisor: SupervisorPipe
) -> None:
    """Run the arm in this process, from start to end. Raises KatanaError.

    content: what an earlier process gave to the supervisor; None at the first start.
    """
    state, scene = None if content is None else _unpacked(content), None
    described = cache(lambda: find_robot(config.settings, config.urdf, config.tool))
    if state is None:
        session = lambda: described().session  # noqa: E731
        scene = next(results("initial_scene", config.options, session), None)
    if scene is not None:
        Meshes(config.folder).put(scene.meshes, ())
    again = content is not None
    make_driver = partial(_driver, config.options)
    arm = RunningArm(
        config.settings, described(), scene, again=again, last=state, make_driver=make_driver
    )
    roles: Roles = {FRONT: arm.attach, STOP: arm.attach_stop}
    for sender in results("tick_sender", config.options):
        arm.record(sender)
        roles[RECORD] = sender.attach
    listener = PrivateListener(config.address, roles, "the arm's process")
    if not again:
        for note in arm.notes:
            print(f"katana450: {note}", file=sys.stderr, flush=True)
    arm.start()
    listener.start()
    keeper = threading.Thread(
        target=_keep, args=(arm.state_publisher, supervisor), name="keep", daemon=True
    )
    keeper.start()
    supervisor.prove(arm.ticks_again)
    supervisor.report(READY)
    while arm.running and not supervisor.ended.wait(WAKE_INTERVAL):
        pass
    if not supervisor.ended.is_set():
        log.critical("The control loop has ended, so the arm's process ends.")
        # At once, without waiting for other threads: a new process begins stopped.
        os._exit(1)
    # First, so that nothing connects again to an arm that ends.
    listener.close()
    arm.stop()
    arm.state_publisher.wake()
    keeper.join()
    # A supervisor that was killed leaves it.
    shutil.rmtree(config.folder, ignore_errors=True)


def _driver(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> Driver | None:
    """Return the driver that an extension has for the arm; None if none has."""
    return next(results("driver", options, robot, q, gripper), None)


def _keep(state_publisher: StatePublisher, supervisor: SupervisorPipe) -> None:
    """Let the supervisor keep each new state for the next process."""
    last = None
    while not supervisor.ended.wait(KEEP_INTERVAL):
        snapshot = state_publisher.snapshot
        state = snapshot.state
        sent = True
        if last is None or state.objects is not last.objects:
            sent = supervisor.keep(SCENE, pickle.dumps(state.objects))
        if state is not last:
            sent = supervisor.keep(KEPT, pickle.dumps(replace(at_rest(state), objects=()))) and sent
        last = state if sent else None
        if last is not None:
            state_publisher.wait_for_change(snapshot, IDLE_INTERVAL, supervisor.ended.is_set)


def _unpacked(content: dict[bytes, bytes]) -> State | None:
    """Return the state that the supervisor kept; None if it has none."""
    if not (KEPT in content and SCENE in content):
        return None
    state: State = pickle.loads(content[KEPT])
    return replace(state, objects=pickle.loads(content[SCENE]))
