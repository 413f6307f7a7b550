"""What one update of the view costs the server while the arm moves, beside writing poses alone.

    python -m benchmarks.view_update

By turns, for each tick of a drive: the app's whole update (arm, conduit, ghost, handle, read-out,
branches), and, on a bare viser server, the turns of as many nodes as the arm has. Wall-clock times
of the calling thread, in which viser packs no message: that is done by a thread of its own.
"""

from __future__ import annotations

import contextlib
import io
import time

import numpy as np
import viser

from app.control import commands as cmd
from app.control.session import Session
from app.drivers.simulated import SimulatedDriver
from app.robot.collision import standing_around, world_of
from app.robot.model import RobotModel, load
from app.robot.props import load_props
from app.runtime.clock import Clock
from app.runtime.loop import ControlLoop
from app.runtime.mailbox import Mailbox
from app.settings import Settings
from app.view.scene import ArmNodes
from app.view.view import View

TICKS = 600
EVERY = 3
"""Ticks a frame: 33 frames a second."""


class Hand(Clock):
    """A clock that is turned by hand."""

    def __init__(self) -> None:
        self.t = 0.0

    def now(self) -> float:
        return self.t

    def sleep_until(self, t: float) -> None:
        self.t = t


def quiet_server() -> viser.ViserServer:
    with contextlib.redirect_stdout(io.StringIO()):
        return viser.ViserServer(host="127.0.0.1", port=0, verbose=False)


def loop_of(model: RobotModel, settings: Settings) -> tuple[ControlLoop, Session, Mailbox, Hand]:
    world, _ = world_of(model)
    assert world is not None
    world = world.with_obstacles(standing_around(load_props()))
    session = Session(model.arm, model.ready(settings.ready), world)
    mailbox, clock = Mailbox(session.check), Hand()
    driver = SimulatedDriver(model.arm, session.ready, gripper=0.0)
    return ControlLoop(session, driver, mailbox, clock, settings.rate), session, mailbox, clock


def main() -> None:
    """Measure and print."""
    settings, model = Settings(), load()
    loop, session, mailbox, clock = loop_of(model, settings)
    server, bare = quiet_server(), quiet_server()
    view = View(server, model, loop.board, mailbox, session.choices, settings.frame_rate)
    arm = ArmNodes(bare, model)
    ours, floor = [], []
    for tick in range(TICKS):
        if tick % 200 == 0:
            side = 1.0 if tick % 400 == 0 else -1.0
            mailbox.put(cmd.SetJoints(session.ready + side * np.array([0.8, 0.2, -0.4, 0.5, 0.9])))
        clock.t += 1.0 / settings.rate
        loop.tick()
        if tick % EVERY or not loop.board.snapshot.state.moving:
            continue
        started = time.perf_counter()
        view.show(loop.board.snapshot)
        ours.append(time.perf_counter() - started)
        state = loop.board.snapshot.state
        started = time.perf_counter()
        arm.move(model.joint_angles(state.q, state.gripper))
        floor.append(time.perf_counter() - started)
    for name, times in (("katana450, a frame", ours), ("turns of the arm's nodes alone", floor)):
        p50, p95 = 1e3 * np.percentile(times, (50, 95))
        print(f"{name:32} {p50:6.2f} ms median  {p95:6.2f} ms 95 %  of {len(times)}")
    print(f"{'ratio':32} {np.median(ours) / np.median(floor):6.2f}")
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
        bare.stop()


if __name__ == "__main__":
    main()
