"""The arm's process: the control loop, and the address at which other processes reach it."""

from __future__ import annotations

import logging
import os
import pickle
import shutil
import sys
import threading
from argparse import Namespace
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from katana450.arm.runtime.pipes.arm_roles import FRONT, RECORD, STOP
from katana450.arm.runtime.pipes.private_listener import PrivateListener, Roles
from katana450.assembly.supervised import KEPT, READY, SCENE, SupervisorPipe
from katana450.extension import ServerFacts, results

if TYPE_CHECKING:
    from katana450.arm.control.state.state import State
    from katana450.arm.drivers.driver import Driver
    from katana450.arm.robot.robot import Robot
    from katana450.arm.runtime.pipes.state_publisher import StatePublisher
    from katana450.maths.geometry.arrays import FloatArray

ARM = "katana450 arm"
"""Name of the process."""

WAKE_INTERVAL = 0.2
"""[s] Interval at which the end of the control loop is checked."""

KEEP_INTERVAL = 0.02
"""[s] Minimum time between two states that the supervisor keeps."""

IDLE_INTERVAL = 5.0
"""[s] Maximum time for which the thread that keeps states sleeps; a new state wakes it."""

log = logging.getLogger(__name__)


def run_arm(
    config: ServerFacts, content: dict[bytes, bytes] | None, supervisor: SupervisorPipe
) -> None:
    """Run the arm in this process, from start to end. Raises KatanaError.

    content: what an earlier process gave to the supervisor; None at the first start.
    """
    from katana450.arm.robot.object_meshes import Meshes
    from katana450.assembly.robot_session import find_robot
    from katana450.assembly.running_arm import RunningArm

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
            sent = supervisor.keep(KEPT, _packed(state)) and sent
        last = state if sent else None
        if last is not None:
            state_publisher.wait_for_change(snapshot, IDLE_INTERVAL, supervisor.ended.is_set)


def _packed(state: State) -> bytes:
    from katana450.arm.control.state.restart import at_rest

    return pickle.dumps(replace(at_rest(state), objects=()))


def _unpacked(content: dict[bytes, bytes]) -> State | None:
    """Return the state that the supervisor kept; None if it has none."""
    if not (KEPT in content and SCENE in content):
        return None
    state: State = pickle.loads(content[KEPT])
    return replace(state, objects=pickle.loads(content[SCENE]))
