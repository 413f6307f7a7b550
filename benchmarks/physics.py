"""Cost of the physics of a tick, beside plain MuJoCo that steps the same model.

    python -m benchmarks.physics

Boxes rest on a table, slide over it, or overlap. Both ways step each tick from the same motion in
turn, several times. The minimum counts, in processor time of the thread.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from benchmarks.collision import quickest
from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.shape import box, half_space
from katana450.maths.collision.world import obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import frozen
from katana450.maths.physics.model import STEP, RigidBody, compile_model
from katana450.maths.physics.simulation import BodySimulation

TICK, SIDE, GAP = 0.01, 0.04, 0.04
TABLE = obstacle("table", np.eye(4), half_space())
STILL = np.zeros(1)
SCENES = {
    "20 at rest": (20, 20, GAP),
    "20 at rest, 5 sliding": (25, 20, GAP),
    "25 sliding": (25, 0, GAP),
    "25 overlapping": (25, 0, -0.3 * SIDE),
}
"""Number of all boxes and of those at rest, and the gap between them [m]."""


def course(count: int, resting: int, gap: float, ticks: int) -> tuple[list[float], list[float]]:
    """Return the times of all ticks [us]: those of the simulation, and those of plain MuJoCo."""
    names = [f"box {n}" for n in range(count)]
    bodies = [RigidBody(name, (box((SIDE,) * 3),), (np.eye(4),), 0.1, 0.5) for name in names]
    places = [((SIDE + gap) * (n % 5), (SIDE + gap) * (n // 5), 0.5 * SIDE) for n in range(count)]
    poses = {
        name: se3.from_rotation_translation(np.eye(3), place)
        for name, place in zip(names, places, strict=True)
    }
    simulation = BodySimulation(Linkage(()), (TABLE,), bodies)
    motion = simulation.begin(poses, None, (), names[resting:])
    velocity = np.zeros((count, 6))
    velocity[resting:, :2] = 1.0, -0.6
    motion = replace(motion, velocity=frozen(velocity))
    model = compile_model(Linkage(()), (TABLE,), bodies).compiled
    data = mujoco.MjData(model)
    ours, plain = list[float](), list[float]()
    for _ in range(ticks):
        start = motion

        def step_plainly() -> None:
            data.qpos[:], data.qvel[:] = start.place.ravel(), start.velocity.ravel()  # noqa: B023
            data.qacc_warmstart[:] = start.memory  # noqa: B023
            mujoco.mj_step(model, data, round(TICK / STEP))

        ours.append(quickest(lambda: simulation.step(start, STILL, STILL, TICK)))  # noqa: B023
        plain.append(quickest(step_plainly))
        motion = simulation.step(start, STILL, STILL, TICK)
    return ours, plain


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.physics", description=__doc__)
    parser.add_argument("--ticks", type=int, default=50, help="of each scene (default: 50)")
    ticks = parser.parse_args(arguments).ticks
    print(f"{ticks} ticks of {1e3 * TICK:.0f} ms; load average {os.getloadavg()[0]:.1f}.\n")
    print("| boxes | tick, median, µs | most | plain MuJoCo, median | most | ratio |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, numbers in SCENES.items():
        times = np.array(course(*numbers, ticks))
        (ours, plain), (slowest, plain_slowest) = np.median(times, axis=1), times.max(axis=1)
        row = f"{ours:.0f} | {slowest:.0f} | {plain:.0f} | {plain_slowest:.0f} | {ours / plain:.2f}"
        print(f"| {name} | {row} |")


if __name__ == "__main__":
    main()
