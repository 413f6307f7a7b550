"""Cost of collision checks: the nearest pair beside a simpler method, and one control tick.

    python -m benchmarks.collision

Every method measures the same random postures in turn, each posture several times, and its minimum
time counts. The tables give the median and the 95th percentile over the postures. Times are
processor times of the thread, so that other load on the machine hardly counts.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from katana450.arm.control.state.state import Status
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.maths.collision.clearance import advance
from katana450.maths.collision.shape import half_space
from katana450.maths.collision.world import CollisionWorld, obstacle
from katana450.maths.geometry.arrays import FloatArray
from katana450.settings import READY_POSTURE_DEG

TICK = 0.01
TURNS = 5
SEED = 450
TICKS = 400

DRIVES: dict[str, tuple[Sequence[float], Sequence[float]]] = {
    "through free space": (READY_POSTURE_DEG, (90.0, -40.0, 60.0, 30.0, 90.0)),
    "into the table": (READY_POSTURE_DEG, (0.0, 7.0, 85.0, 8.0, 0.0)),
    "low over the table": ((0.0, -37.3, 97.0, -2.0, 0.0), (120.0, -37.3, 97.0, -2.0, 0.0)),
    "folding up": (READY_POSTURE_DEG, (0.0, -124.0, 127.0, 107.0, 0.0)),
}
"""Start and goal of each drive, joint angles [deg]."""


def approach(x: FloatArray, end: FloatArray, speed: FloatArray, dt: float) -> FloatArray:
    """Return ``x`` (k,) after ``dt`` [s] of motion straight towards ``end`` at maximum speed."""
    needed = float(np.max(np.abs(end - x) / speed))
    return end if needed <= dt else np.asarray(x + (end - x) * (dt / needed))


class Row(NamedTuple):
    """One line of a table: times in microseconds, and a remark."""

    name: str
    median: float
    most: float
    remark: str


def world_on_table(robot: Robot) -> CollisionWorld:
    """Return the arm's bodies above the table."""
    world, _ = world_of(robot)
    if world is None:
        raise SystemExit("The robot description has no collision shapes.")
    return world.with_obstacles([obstacle("table", np.eye(4), half_space())])


def quickest(work: Callable[[], object], turns: int = TURNS) -> float:
    """Return the minimum of several times [us]."""
    best = float("inf")
    for _ in range(turns):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return 1e6 * best


def nearest_rows(world: CollisionWorld, postures: FloatArray) -> list[Row]:
    """Return the rows of the methods that find the nearest pair."""
    every = range(len(world.first))
    methods: dict[str, Callable[[FloatArray], object]] = {
        "katana450 `nearest`": world.nearest,
        "every pair": lambda x: min(map(world.at(x).distance, every)),
    }
    times: dict[str, list[float]] = {name: [] for name in methods}
    for x in postures:
        for name, method in methods.items():
            times[name].append(quickest(lambda method=method, x=x: method(x)))  # type: ignore[misc]
    remarks = (f"{len(world.part_of)} bodies, {len(world.first)} pairs", "")
    return [
        Row(name, float(np.median(took)), float(np.percentile(took, 95.0)), remark)
        for (name, took), remark in zip(times.items(), remarks, strict=True)
    ]


def tick_rows(arm: MountedArm, world: CollisionWorld) -> list[Row]:
    """Return the rows with the time of one tick of each drive."""
    rows = []
    speed = np.append(arm.chain.speed, arm.gripper.speed)
    for name, ends in DRIVES.items():
        x, goal = (np.append(np.radians(end), 0.0) for end in ends)
        took = []
        remark = Status.OK
        for _ in range(TICKS):
            towards = approach(x, goal, speed, TICK)
            if (towards == x).all():
                break
            took.append(quickest(lambda x=x, end=towards: advance(world, x, end, TICK)))  # type: ignore[misc]
            step = advance(world, x, towards, TICK)
            x = step.x
            if step.stopped:
                remark = Status.BLOCKED
                break
        rows.append(
            Row(name, float(np.median(took)), float(np.percentile(took, 95.0)), remark.value)
        )
    return rows


def table(heading: str, rows: Sequence[Row]) -> str:
    """Return the rows in Markdown."""
    lines = [f"| {heading} | median, µs | 95 %, µs | |", "|---|--:|--:|---|"]
    lines += [f"| {r.name} | {r.median:.0f} | {r.most:.0f} | {r.remark} |" for r in rows]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print both tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.collision", description=__doc__)
    parser.add_argument("--postures", type=int, default=100, help="how many (default: 100)")
    count = parser.parse_args(arguments).postures
    robot = load()
    arm = robot.require_arm()
    start = time.perf_counter()
    world = world_on_table(robot)
    world.load()
    built = time.perf_counter() - start
    chain, gripper = arm.chain, arm.gripper
    lower, upper = np.append(chain.lower, gripper.lower), np.append(chain.upper, gripper.upper)
    postures = np.random.default_rng(SEED).uniform(lower, upper, (count, len(lower)))
    print(f"{count} postures of seed {SEED}; load average {os.getloadavg()[0]:.1f}.")
    print(f"Bodies read and pairs found in {built:.2f} s.\n")
    print(table("the nearest pair", nearest_rows(world, postures)))
    print()
    print(table("one tick of a drive", tick_rows(arm, world)))


if __name__ == "__main__":
    main()
