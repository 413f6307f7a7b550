"""Cost of collision checks: the nearest pair beside simpler methods, and one control tick.

    python -m benchmarks.collision

Every method measures the same random postures in turn, each posture several times, and its minimum
time counts. The tables give the median and the 95th percentile over the postures. Times are
processor times of the thread, so that other load on the machine hardly counts. FCL, which measures
where coal has no wheel, is compared with coal in the same run.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple
from unittest import mock

import coal
import numpy as np

from katana450.arm.control.state import Status
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.maths.collision import engine as engines
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


@contextmanager
def without_coal() -> Iterator[None]:
    """Choose the engine as on a machine without coal."""
    with mock.patch.object(engines, "find_spec", return_value=None):
        engines.engine.cache_clear()
        yield
    engines.engine.cache_clear()


def world_on_table(robot: Robot) -> CollisionWorld:
    """Return the arm's bodies above the table."""
    world, _ = world_of(robot)
    if world is None:
        raise SystemExit("The robot description has no collision shapes.")
    return world.with_obstacles([obstacle("table", np.eye(4), half_space())])


class RawMeshes:
    """The visible triangles of each link, without hulls, for all pairs of a world without table."""

    def __init__(self, robot: Robot, world: CollisionWorld) -> None:
        self._world = world
        bodies = {body.name: body for body in robot.links}
        self._meshes = {}
        for number, part in enumerate(world.parts):
            if part.name in bodies:
                meshes = [visual.mesh for visual in bodies[part.name].visuals]
                self._meshes[number] = _bvh(meshes)
        self._pairs = [(a, b) for a, b in world.pairs if a in self._meshes and b in self._meshes]
        self._request = coal.DistanceRequest()

    def nearest(self, x: FloatArray) -> float:
        """Return the minimum distance of two links [m]."""
        poses = self._world.linkage.poses(x)
        placed = {}
        for number in self._meshes:
            part = self._world.parts[number]
            T = poses[part.mover] @ part.T_mover_shape[0]
            placed[number] = coal.Transform3s(T[:3, :3], T[:3, 3])
        nearest: float = min(
            coal.distance(
                self._meshes[a],
                placed[a],
                self._meshes[b],
                placed[b],
                self._request,
                coal.DistanceResult(),
            )
            for a, b in self._pairs
        )
        return nearest


def _bvh(meshes: Sequence[Any]) -> Any:
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    count = 0
    for mesh in meshes:
        points.extend(list(np.asarray(mesh.vertices)))
        faces.extend([coal.Triangle(*face) for face in (mesh.faces + count).tolist()])
        count += len(mesh.vertices)
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), count)
    model.addSubModel(points, faces)
    model.endModel()
    return model


def quickest(work: Callable[[], object], turns: int = TURNS) -> float:
    """Return the minimum of several times [us]."""
    best = float("inf")
    for _ in range(turns):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return 1e6 * best


def nearest_rows(
    robot: Robot, world: CollisionWorld, by_fcl: CollisionWorld, postures: FloatArray
) -> list[Row]:
    """Return the rows of the methods that find the nearest pair."""
    every = range(len(world.first))
    raw = RawMeshes(robot, world)
    methods: dict[str, tuple[Callable[[FloatArray], object], int]] = {
        "katana450 `nearest`": (world.nearest, TURNS),
        "katana450 `nearest`, by FCL": (by_fcl.nearest, TURNS),
        "coal, the same hulls, every pair": (
            lambda x: min(map(world.at(x).distance, every)),
            TURNS,
        ),
        "coal, the visible meshes, without the table": (raw.nearest, 1),
    }
    times: dict[str, list[float]] = {name: [] for name in methods}
    for x in postures:
        for name, (method, turns) in methods.items():
            times[name].append(quickest(lambda method=method, x=x: method(x), turns))  # type: ignore[misc]
    ours, fcl = (np.array(times[name]) for name in list(times)[:2])
    remarks = (
        f"{len(world.part_of)} bodies, {len(world.first)} pairs",
        f"{np.median(fcl / ours):.2f} times coal",
        "",
        f"{len(raw._pairs)} pairs of links",
    )
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
    with without_coal():
        by_fcl = world_on_table(robot)
        by_fcl.load()
    postures = np.random.default_rng(SEED).uniform(lower, upper, (count, len(lower)))
    print(f"{count} postures of seed {SEED}; load average {os.getloadavg()[0]:.1f}.")
    print(f"Bodies read and pairs found in {built:.2f} s.\n")
    print(table("the nearest pair", nearest_rows(robot, world, by_fcl, postures)))
    print()
    ticks = tick_rows(arm, world)
    print(table("one tick of a drive", ticks))
    print()
    slower = [
        row._replace(remark=f"{row.median / coal.median:.2f} times coal, {row.remark}")
        for row, coal in zip(tick_rows(arm, by_fcl), ticks, strict=True)
    ]
    print(table("one tick of a drive, by FCL", slower))


if __name__ == "__main__":
    main()
