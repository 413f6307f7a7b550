"""Cost of one update of the view for the server while the arm moves, beside writing poses alone.

    python -m benchmarks.view_update

For each frame of a drive at its real pace two updates alternate. The first is the app's whole
update (arm, conduit, ghost, handle, read-out, branches). The second turns as many nodes as the arm
has on a bare viser server, each with viser's own setter. Times are wall-clock times of the calling
thread, in which viser packs no message, because another thread does that.
"""

from __future__ import annotations

import contextlib
import io
import math
import time
from argparse import Namespace
from collections.abc import Callable
from threading import Event

import numpy as np
import viser

from katana450.arm.control import commands as cmd
from katana450.arm.control.commands import Command
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.clock import Clock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.assembly.frontend import layers
from katana450.extensions.kinematics.json_lines import initial_obstacles
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.view.view import View, ViewOptions
from katana450.settings import Settings
from tests.view.gestures import RecordedGestures

TICKS = 600
EVERY = 3
"""Ticks per frame: 33 frames a second."""


class Hand(Clock):
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.t = 0.0

    def now(self) -> float:
        """Return the time that was set [s]."""
        return self.t

    def sleep_until(self, t: float, _wake: Event | None = None) -> None:
        """Set the time to ``t`` [s]."""
        self.t = t


def quiet_server() -> viser.ViserServer:
    """Start a viser server that prints nothing."""
    with contextlib.redirect_stdout(io.StringIO()):
        return viser.ViserServer(host="127.0.0.1", port=0, verbose=False)


def loop_of(robot: Robot, settings: Settings) -> tuple[ControlLoop, Session, Mailbox, Hand]:
    """Return the control loop of ``robot`` with its session, mailbox and clock."""
    arm = robot.require_arm()
    world, _ = world_of(robot)
    assert world is not None
    world = world.with_obstacles(initial_obstacles(load_props()))
    session = Session(arm, arm.ready(settings.ready), world)
    mailbox, clock = Mailbox(session.check), Hand()
    driver = SimulatedDriver(arm, session.ready, gripper=0.0)
    return ControlLoop(session, driver, mailbox, clock, settings.rate), session, mailbox, clock


class BareNodes:
    """One node for each joint of the arm, turned by viser's own setter."""

    def __init__(self, server: viser.ViserServer, joints: int) -> None:
        self.frames = [server.scene.add_frame(f"/{i}", show_axes=False) for i in range(joints)]

    def move(self, q: FloatArray) -> None:
        """Turn each node by its joint angle [rad]."""
        for frame, angle in zip(self.frames, q.tolist(), strict=True):
            frame.wxyz = (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))


def to_and_fro(tick: int, session: Session, _state: State) -> Command | None:
    """Move all joints from one side to the other every two seconds."""
    if tick % 200:
        return None
    side = 1.0 if tick % 400 == 0 else -1.0
    return cmd.SetJoints(session.ready + side * np.array([0.8, 0.2, -0.4, 0.5, 0.9]))


def dragged(tick: int, session: Session, state: State) -> Command | None:
    """Move around a circle of 6 cm every two seconds, with 20 targets a second like the gizmo."""
    if tick % 5:
        return None
    centre = forward(session.require_arm().chain_to(state.tool), session.ready)[:3, 3]
    turn = math.tau * tick / 200.0
    return cmd.MoveTool(centre + 0.06 * np.array([0.0, math.sin(turn), math.cos(turn) - 1.0]))


def timed(show: Callable[[], None]) -> float:
    """Return the time of ``show`` [s]."""
    started = time.perf_counter()
    show()
    return time.perf_counter() - started


def drive(commands: Callable[[int, Session, State], Command | None]) -> None:
    """Measure one drive, and print."""
    settings, robot = Settings(), load()
    loop, session, mailbox, clock = loop_of(robot, settings)
    server, bare = quiet_server(), quiet_server()
    view = View(
        server,
        robot,
        loop.state_publisher,
        RecordedGestures(),
        lambda: mailbox.last_ticket,
        session,
        settings.frame_rate,
        ViewOptions(layers(Namespace(workspace=None))),
    )
    view.add_panel(lambda _: ())
    nodes = BareNodes(bare, robot.require_arm().chain.n)
    ours: list[float] = []
    floor: list[float] = []
    started = time.perf_counter()
    for tick in range(TICKS):
        command = commands(tick, session, loop.state_publisher.snapshot.state)
        if command is not None:
            mailbox.put(command)
        clock.t += 1.0 / settings.rate
        # At the pace of the app, so that values shown ten times a second come every fourth frame.
        time.sleep(max(0.0, started + clock.t - time.perf_counter()))
        loop.tick()
        if tick % EVERY or not loop.state_publisher.snapshot.state.moving:
            continue
        ours.append(timed(lambda: view.show(loop.state_publisher.snapshot)))
        floor.append(timed(lambda: nodes.move(loop.state_publisher.snapshot.state.q)))
    print(f"{commands.__name__.replace('_', ' ')}, {len(ours)} frames")
    for name, times in (("katana450", ours), ("turns alone, by viser's setter", floor)):
        p50, p95 = 1e3 * np.percentile(times, (50, 95))
        mean = 1e3 * np.mean(times)
        print(f"  {name:32} {p50:6.2f} ms median {mean:6.2f} ms mean {p95:6.2f} ms 95 %")
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
        bare.stop()


def main() -> None:
    """Measure both drives."""
    for commands in (to_and_fro, dragged):
        drive(commands)


if __name__ == "__main__":
    main()
