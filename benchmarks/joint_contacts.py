"""Processor time of one tick of a robot that is driven joint by joint, with and without contacts.

``python -m benchmarks.joint_contacts [URDF...]`` measures a hand of 16 joints that is made up here,
and the robots in the files. Both sessions go to the same random postures.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.robot.loader import load
from katana450.extensions.bodies.robot_world import robot_world
from katana450.maths.motion.limiter import Limits
from tests.robot.hands import hand

TARGETS, TICKS, DT = 12, 150, 0.01


def measure(path: Path) -> None:
    """Print the times of the robot at ``path``, driven by its joints alone."""
    robot = replace(load(path), arm=None)
    joints = robot.joint_group
    begun = time.process_time()
    world, _, _ = robot_world(robot)
    made = time.process_time() - begun
    if world is None:
        print(f"{robot.name}: no shapes")
        return
    print(
        f"{robot.name}: {joints.n} joints, {len(world.mover_of)} bodies, {len(world.first)} pairs, "
        f"world made in {made:.2f} s"
    )
    for name, checked in (("without contacts", None), ("with contacts", world)):
        times, blocked = ticks(Session(joints, joints.ready, checked), joints.limits)
        marks = " ".join(f"{each:6.2f}" for each in np.percentile(times, (50, 95, 99)))
        print(f"  {name:17} p50, p95, p99: {marks} ms; {blocked:.0%} of the ticks before a contact")


def ticks(session: Session, limits: Limits) -> tuple[list[float], float]:
    """Return the processor time [ms] of each tick, and the fraction of ticks before a contact."""
    random, t, blocked = np.random.default_rng(1), 0.0, 0
    times: list[float] = []
    for _ in range(TARGETS):
        q = random.uniform(limits.lower, limits.upper)
        # From the initial posture each time, so that no contact holds up the rest.
        state = session.begin(session.ready, 0.0, t)
        commands: tuple[cmd.Command, ...] = (cmd.SetJoints(q),)
        for _ in range(TICKS):
            t += DT
            begun = time.thread_time()
            state = session.step(state, commands, t)
            times.append(1e3 * (time.thread_time() - begun))
            state = session.observe(state, state.setpoint, 0.0)
            commands = ()
            blocked += state.blocked
    return times, blocked / (TARGETS * TICKS)


def main() -> None:
    """Measure the made-up hand and the files that are named."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hand.urdf"
        path.write_text(hand())
        for each in (path, *map(Path, sys.argv[1:])):
            measure(each)


if __name__ == "__main__":
    main()
