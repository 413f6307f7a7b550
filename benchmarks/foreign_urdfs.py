"""Robots of other people: what the app does with every URDF file below a folder.

Each file is read as `katana450 serve --urdf` reads it. A robot with a tool makes a step of 10 mm
with it in a simulated session. If its tool has to be named, the link at the end of its longest
chain is. The places of all links at random joint values are compared with those of pinocchio, which
runs in an environment of its own. Meshes may be missing.

``python -m benchmarks.foreign_urdfs FOLDER``
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers import prepare
from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.errors import KatanaError, RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.settings import Settings

ROOT = Path(__file__).resolve().parents[1]
WORKER = Path(__file__).with_name("foreign_urdfs_worker.py")
STEP = 0.01
"""[m] Step of the tool."""
ARRIVED = 1e-6
"""[m] Maximum distance from the end of the step."""
TICK, TICKS = 0.01, 600
POSTURES = 5
FREE_RANGE = 2.0
"""[rad, m] Range of the values of joints without limits."""


@dataclass
class Result:
    """The result of one file.

    Attributes:
        name: of the robot.
        kind: in words, how it is driven.
        detail: the kinematics, or the reason why it is not driven by its tool.
        step: whether a step of its tool arrived; None without a tool.
        rounding: largest difference [m, 1] of the tool's pose between the kinematics that drive it
            and the file, whose lengths and angles they round to exact ones.
        away: largest difference [m, 1] of a link's pose from pinocchio's; None if pinocchio did
            not read the file.
        postures: joint values, and the places of the links there.
    """

    name: str
    kind: str
    detail: str = ""
    step: bool | None = None
    rounding: float | None = None
    away: float | None = None
    postures: list[tuple[dict[str, float], dict[str, FloatArray]]] = field(default_factory=list)


def result_of(path: Path, rng: np.random.Generator) -> Result:
    """Return what the app does with the file at ``path``."""
    try:
        found, tool = _driven(path)
    except KatanaError as error:
        return Result(path.stem, "refused", str(error))
    robot = found.robot
    result = Result(robot.name, "joint by joint", robot.why)
    if robot.arm is not None:
        result.kind = "by its tool" if tool is None else "by its tool, named with --tool"
        result.detail = getattr(robot.arm.kinematics, "method", "closed form for five axes")
        result.step = _steps(found.session)
        result.rounding = _rounding(robot, rng)
    for _ in range(POSTURES):
        values = robot.every({name: _value(robot, name, rng) for name in robot.driven})
        result.postures.append((values, robot.frames(values)))
    return result


def _driven(path: Path) -> tuple[DescribedRobot, str | None]:
    """Return the robot and the link that had to be named as its tool, if any."""
    found = find_robot(Settings(), path, None)
    if found.robot.arm is not None:
        return found, None
    robot = found.robot
    parents = {link.parent for link in robot.links}
    ends = [link for link in robot.links if link.name not in parents]
    ends.sort(key=lambda link: -sum(each.joint is not None for each in robot.path_to(link)))
    for link in ends[:3]:
        try:
            return find_robot(Settings(), path, link.name), link.name
        except RobotDescriptionError:
            continue
    return found, None


def _value(robot: Robot, name: str, rng: np.random.Generator) -> float:
    joint = robot.joints[name]
    lower = max(joint.lower, -FREE_RANGE)
    return float(rng.uniform(lower, max(min(joint.upper, FREE_RANGE), lower)))


def _rounding(robot: Robot, rng: np.random.Generator) -> float:
    arm, worst = robot.require_arm(), 0.0
    chain = arm.chain_to(arm.default_tool)
    for q in rng.uniform(chain.lower, chain.upper, (POSTURES, chain.n)):
        place = robot.frames(robot.joint_values(q, 0.0))[arm.default_tool]
        reached = arm.T_base_shoulder @ forward(chain, q)
        worst = max(worst, float(np.abs(reached - place).max()))
    return worst


def _steps(session: Session) -> bool:
    """Return whether a step of the tool along some axis of the base arrives."""
    arm = session.require_arm()
    for axis in range(3):
        for side in (1.0, -1.0):
            state = session.begin(session.ready, 0.0, 0.0)
            chain = arm.chain_to(state.tool)
            by = np.zeros(arm.kinematics.freedoms)
            by[axis] = side * STEP
            wanted = forward(chain, state.q)[:3, 3] + by[:3]
            commands: tuple[cmd.Command, ...] = (cmd.StepTool(by),)
            for _ in range(TICKS):
                state = session.step(state, commands, state.t + TICK)
                state = session.observe(state, state.setpoint, 0.0)
                commands = ()
                if not state.moving and state.since is None:
                    break
            if np.linalg.norm(forward(chain, state.q)[:3, 3] - wanted) <= ARRIVED:
                return True
    return False


def compare(results: dict[Path, Result], python: Path) -> None:
    """Set how far the links are from those of pinocchio."""
    asked = {
        str(path): [values for values, _ in result.postures] for path, result in results.items()
    }
    with tempfile.TemporaryDirectory() as folder:
        question, answer = Path(folder) / "question.json", Path(folder) / "answer.json"
        question.write_text(json.dumps(asked), encoding="utf-8")
        subprocess.run([str(python), str(WORKER), str(question), str(answer)], check=True)
        found: dict[str, list[dict[str, Any]] | None] = json.loads(answer.read_text())
    for path, result in results.items():
        theirs = found[str(path)]
        if theirs is None or not result.postures:
            continue
        result.away = max(
            float(np.abs(np.array(places[name]) - frame).max())
            for (_, frames), places in zip(result.postures, theirs, strict=True)
            for name, frame in frames.items()
            if name in places
        )


def table(results: dict[Path, Result], folder: Path) -> str:
    """Return the results as a table, and their numbers."""
    lines = [
        "| file | driven | kinematics, or why not | step | rounding | from pinocchio |",
        "|---|---|---|---|--:|--:|",
    ]
    for path, each in results.items():
        away, rounding = (
            "" if value is None else f"{value:.1e}" for value in (each.away, each.rounding)
        )
        step = "" if each.step is None else "arrived" if each.step else "no"
        lines.append(
            f"| {path.relative_to(folder)} | {each.kind} | {each.detail} | {step} | "
            f"{rounding} | {away} |"
        )
    known = [each.away for each in results.values() if each.away is not None]
    stepped = [each.step for each in results.values() if each.step is not None]
    lines += [
        "",
        *(f"{number} {kind}" for kind, number in Counter(e.kind for e in results.values()).items()),
        f"{sum(stepped)} of {len(stepped)} tools made their step",
        f"{len(known)} compared with pinocchio, at most {max(known, default=0.0):.1e} away",
    ]
    return "\n".join(lines)


def main() -> None:
    """Read the files and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--peers", type=Path, default=ROOT / ".venv-bench")
    options = parser.parse_args()
    python = prepare(options.peers.absolute(), "pin")
    if isinstance(python, str):
        parser.error(f"pinocchio could not be installed: {python}")
    rng, results = np.random.default_rng(23), {}
    for path in sorted(options.folder.rglob("*.urdf")):
        results[path] = result_of(path, rng)
        print(f"{path.name}: {results[path].kind}", file=sys.stderr, flush=True)
    compare(results, python)
    print(table(results, options.folder))


if __name__ == "__main__":
    main()
