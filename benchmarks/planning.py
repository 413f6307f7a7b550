"""Measure the planning of scripts: time per line, its growth, and the cost of objects.

    python -m benchmarks.planning

The times are those of the processor.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import se3
from katana450.resources import URDF_PATH
from katana450.settings import Settings

STEPS = (10, 100, 500)
"""Numbers of lines of a script."""

OBJECTS = (0, 20, 50)
"""Numbers of objects around the arm."""

COMPARED = 100
"""Number of lines with which the objects are compared."""

HEAD = "frame: base\nsteps:\n  - move: {x: 350, y: 0, z: 220, pitch: 40, roll: 0}\n"


def lines(count: int) -> str:
    """Return a script with ``count`` lines, each of them different."""
    rng = np.random.default_rng(4)
    places = rng.uniform((330.0, -80.0, 200.0), (390.0, 80.0, 260.0), (count, 3)).round(2)
    steps = [f"  - line: {{to: {{x: {x}, y: {y}, z: {z}}}}}\n" for x, y, z in places.tolist()]
    return HEAD + "".join(steps)


def boxes(count: int) -> tuple[SceneObject, ...]:
    """Return boxes of 40 mm on the table, on circles round the place of the lines."""
    found = []
    for number in range(count):
        angle, radius = 2.4 * number, 0.28 + 0.004 * number
        at = (0.1 + radius * np.cos(angle), radius * np.sin(angle), 0.0)
        T = se3.from_rotation_translation(np.eye(3), at)
        found.append(SceneObject(f"box {number + 1}", Shape.BOX, (0.04, 0.04, 0.04), T))
    return tuple(found)


def planning_time(plan_context: PlanContext, text: str, objects: Sequence[SceneObject]) -> float:
    """Return the processor time [s] of planning ``text`` among ``objects``."""
    session = plan_context.session
    start = replace(session.begin(session.ready, 0.0, 0.0), objects=tuple(objects), poured=None)
    script = parse(text)
    began = time.process_time()
    compiled(script, plan_context, start)
    return time.process_time() - began


def main() -> None:
    """Print the table."""
    robot, session, _ = describe_robot(Settings(), URDF_PATH, None)
    plan_context = PlanContext(session, robot.require_arm().T_base_shoulder)
    planning_time(plan_context, lines(2), ())
    for count in STEPS:
        taken = planning_time(plan_context, lines(count), ())
        print(f"{count} lines: {taken:.2f} s, {1e3 * taken / count:.1f} ms each")
    alone = 0.0
    for number in OBJECTS:
        taken = planning_time(plan_context, lines(COMPARED), boxes(number))
        alone = alone or taken
        print(f"{COMPARED} lines, {number} objects: {taken:.2f} s, {taken / alone:.2f} times")


if __name__ == "__main__":
    main()
