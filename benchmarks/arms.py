"""The table of what each arm can do: every row is measured on a file that is loaded as users do.

The arms are that of the app and those with published dimensions in `tests/general_arms`. Other
files, and robots of the gallery by name, add rows: `python -m benchmarks.arms my_arm.urdf --arm
ur5e`.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from time import perf_counter, thread_time
from typing import NamedTuple

import numpy as np

import katana450
from benchmarks import kinematics_report as report
from benchmarks.kinematics import ROOT
from katana450.arm.control.arm import NO_GRIPPER
from katana450.arm.control.commands.tool_commands import Position
from katana450.extensions.gallery.arms_command import file_of, robot_named
from katana450.extensions.programs.run.simulation import plan_script
from katana450.extensions.programs.script.script import parse
from katana450.maths.kinematics.chain import Chain
from katana450.resources import URDF_PATH
from tests.general_arms import published_arms
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.gripping_arms import gripping_urdf
from tests.general_arms.published_hands import px150_urdf, so101_urdf

DOCS = ROOT / "docs" / "library.md"
BEGIN = "<!-- arms: written by `make bench-arms ARGS=--docs` -->"
END = "<!-- arms: end -->"

STAND = (
    '<link name="stand"/><joint name="stand_joint" type="fixed"><parent link="stand"/>'
    '<child link="base_link"/><origin xyz="0 0 0.5"/></joint></robot>'
)
"""[m] A stand, because the published dimensions of some arms begin at the shoulder."""


def drawn(chain: Chain) -> str:
    """Return the URDF of ``chain`` on a stand, whose links are drawn as thin rods."""
    text = chain_urdf("arm", chain).replace('radius="0.02"', 'radius="0.005"')
    return text.replace("</robot>", STAND)


PUBLISHED: Mapping[str, str] = {
    "SO-101": so101_urdf(),
    "PincherX-150": px150_urdf(),
    "PincherX-100": drawn(published_arms.PINCHERX_100),
    "OpenMANIPULATOR-X": gripping_urdf("OpenMANIPULATOR-X"),
    "UR5e": gripping_urdf("UR5e"),
    "UR5e, its maker's digits": drawn(published_arms.UR5E_FILE),
    "Puma 560": drawn(published_arms.PUMA_560),
    "KUKA KR 6": gripping_urdf("KR 6"),
    **{name: drawn(chain) for name, chain in published_arms.OFFSET.items() if "IRB" not in name},
    "Panda": gripping_urdf("Panda"),
    "iiwa 7": drawn(published_arms.IIWA_7),
    "xArm7": drawn(published_arms.XARM_7),
    **{name: drawn(chain) for name, chain in published_arms.NEAR_MISS.items()},
    "skewed 6": drawn(published_arms.SKEWED_6),
}
"""URDF of each arm with published dimensions."""

POSES, PASSES = 60, 5

STEP = 0.05
"""[m] Length of a drag."""

ARRIVED = 1e-6
"""[m] Distance within which a drag has arrived."""

TICK, MAX_TICKS = 0.01, 1500

BOXES = ((40, 50, 60), (25, 20, 50))
"""[mm] Sizes of the box that is picked."""

PLACES = (0.45, 0.6, 0.35)
"""[1] Distances of the box from the base that are tried, relative to the reach of the arm."""

HEAD = ("arm", "axes", "solver", "branches", "exact, mm", "call, µs", "drags", "tick, ms", "grasp")


class Drags(NamedTuple):
    """The drags of an arm: how many arrived on their branch, of how many, and a tick's time [s]."""

    arrived: int
    number: int
    tick: float


def cells(name: str, path: Path) -> tuple[str, ...]:
    """Return the row of the arm in the file ``path``."""
    arm = katana450.load(path)
    T = arm.fk(np.random.default_rng(1).uniform(arm.lower, arm.upper, (POSES, arm.n)))
    exact = [[solution for solution in arm.ik(pose) if solution.exact] for pose in T]
    error = max(solution.position_error for solutions in exact for solution in solutions)
    dragged = drags(arm)
    return (
        name,
        str(arm.n),
        arm.method.partition(", because")[0],
        f"{sum(map(len, exact)) / POSES:.1f}",
        f"{1e3 * error:.0e}",
        f"{1e6 * time_of_a_call(arm, T):.3g}",
        f"{dragged.arrived} of {dragged.number}",
        f"{1e3 * dragged.tick:.2f}",
        grasp(arm, path),
    )


def time_of_a_call(arm: katana450.Arm, T: np.ndarray) -> float:
    """Return the mean time [s] of `arm.ik` with its first solution read, the least of PASSES."""
    least = np.full(len(T), np.inf)
    for _ in range(PASSES):
        for k, pose in enumerate(T):
            begin = perf_counter()
            _ = next(iter(arm.ik(pose))).q
            least[k] = min(least[k], perf_counter() - begin)
    return float(least.mean())


def drags(arm: katana450.Arm) -> Drags:
    """Drag the tool from the ready posture by STEP along each axis of the base, to both sides."""
    arrived, ticks, seconds = 0, 0, 0.0
    ways = [sign * way for way in np.eye(3) for sign in (1.0, -1.0)]
    for way in ways:
        state = replace(arm.standing(arm.ready), objects=())
        branch = state.branch
        target = arm.fk(state.q)[:3, 3] + STEP * way
        commands: tuple[Position, ...] = (Position(target),)
        for _ in range(MAX_TICKS):
            begin = thread_time()
            state = arm.session.step(state, commands, state.t + TICK)
            seconds, ticks, commands = seconds + thread_time() - begin, ticks + 1, ()
            state = arm.session.observe(state, state.setpoint, state.gripper_setpoint)
            if not state.moving and state.since is None:
                break
        tip = arm.fk(state.q)[:3, 3]
        arrived += float(np.linalg.norm(tip - target)) <= ARRIVED and state.branch == branch
    return Drags(arrived, len(ways), seconds / ticks)


def grasp(arm: katana450.Arm, path: Path) -> str:
    """Return whether a script picks a box from the table and places it beside."""
    if arm.mounted.gripper == NO_GRIPPER:
        return "no hand"
    reach, reason = 1e3 * arm.chain.reach, ""
    for size in BOXES:
        for ratio in PLACES:
            x, y = ratio * reach, 0.2 * reach
            text = (
                "frame: base\nscene:\n  - {name: part, shape: box, size: "
                f"{list(size)}, pose: [{x:.0f}, {0.5 * y:.0f}, 0, 0, 0, 17], can_be_held: true}}\n"
                "steps:\n  - pick: part\n"
                f"  - place: {{at: {{x: {x:.0f}, y: {-y:.0f}}}}}\n  - home\n"
            )
            try:
                plan_script(parse(text), path)
            except katana450.KatanaError as error:
                reason = str(error)
            else:
                return "yes"
    return reason.partition(". ")[0]


def rows(files: Mapping[str, Path]) -> Iterator[tuple[str, ...]]:
    """Yield the row of each arm with published dimensions, then those of ``files``."""
    yield cells("Katana450", URDF_PATH)
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, text) in enumerate(PUBLISHED.items()):
            path = Path(folder) / f"arm{number}.urdf"
            path.write_text(text, encoding="utf-8")
            yield cells(name, path)
    for name, path in files.items():
        yield cells(name, path)


def markdown(files: Mapping[str, Path]) -> str:
    """Return the table with the conditions of its measurement."""
    lines = [f"| {' | '.join(HEAD)} |", "|---|--:|---|--:|--:|--:|--:|--:|---|"]
    for row in rows(files):
        print(*row, sep="; ", flush=True)
        lines.append(f"| {' | '.join(row)} |")
    machine = f"{report.processor()}, Python {platform.python_version()}, numpy {np.__version__}"
    return "\n".join([f"{machine}; load average {os.getloadavg()[0]:.1f}.", "", *lines])


def main() -> None:
    """Measure, print the rows, and write the table into the documentation if requested."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="URDF of another arm")
    parser.add_argument("--arm", nargs="+", default=[], metavar="NAME", help="robots by name")
    parser.add_argument("--docs", action="store_true", help=f"put the table into {DOCS.name}")
    options = parser.parse_args()
    files = {path.stem: path for path in options.files}
    files |= {name: file_of(robot_named(name)) for name in options.arm}
    text = markdown(files)
    if options.docs:
        report.write_between(DOCS, BEGIN, END, text)


if __name__ == "__main__":
    main()
