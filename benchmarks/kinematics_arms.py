"""Inverse kinematics of arms with six and seven axes: the app beside other libraries.

As `benchmarks.kinematics`, with the arms UR5e, KUKA KR 6 and Panda from their published
dimensions. A second task of the arms with six axes has poses at singularities: a wrist in line, a
stretched elbow, and both within 1e-9 to 1e-3 rad.
"""

from __future__ import annotations

import argparse
import itertools
import os
import platform
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks import kinematics_report as report
from benchmarks.kinematics import DOCS, OWN, ROOT, Bench, Entry
from benchmarks.kinematics_own import chain_of
from benchmarks.kinematics_report import Machine, Row
from benchmarks.kinematics_task import FloatArray, Task
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward

BEGIN = "<!-- kinematics of arms: written by `python -m benchmarks.kinematics_arms --docs` -->"
END = "<!-- kinematics of arms: end -->"

CLOSED = (
    Entry(OWN, "katana450 `arm.ik`"),
    Entry("eaik", "EAIK", "EAIK"),
    Entry("ik-geo", "ik-geo", "ik-geo"),
)
BATCH = CLOSED[:2]
NUMERICAL = (
    Entry("katana450-numerical", "katana450, numerical, limits kept"),
    Entry("trac-ik", "TRAC-IK, limits kept, 5 ms", "pytracik"),
    Entry("roboticstoolbox", "roboticstoolbox `ik_LM`, limits kept", "roboticstoolbox-python"),
    Entry("pinocchio", "pinocchio, closed loop", "pin"),
    Entry("mink", "mink, limits kept", "mink"),
)
SIX = (*CLOSED, *NUMERICAL)
SEVEN = (*CLOSED[:1], *NUMERICAL)

LETTERS = {letter: np.eye(3)["xyz".index(letter)] for letter in "xyz"}


@dataclass(frozen=True, eq=False)
class ArmData:
    """An arm whose axes at zero lie along those of its base, but for the rounding of its file.

    Attributes:
        name: for people.
        letters: directions of the axes.
        places: a point on each axis, then the tool point [m].
        limits: limits of each joint [deg].
        elbow: the angle of axis 3 at which the arm is stretched [rad].
        tilt: angle [rad] by which the file is off at the right angles after axes 1 and 4.
    """

    name: str
    letters: str
    places: Sequence[tuple[float, float, float]]
    limits: Sequence[tuple[float, float]]
    elbow: float = 0.0
    tilt: float = 0.0

    def task(self, q: Callable[[np.random.Generator, FloatArray, FloatArray], FloatArray]) -> Task:
        """Return the task with the poses at the joint angles ``q(rng, lower, upper)`` (N, n)."""
        lower, upper = np.radians(self.limits).T
        axes = np.array([LETTERS[letter] for letter in self.letters])
        offsets = np.diff(np.array(self.places), axis=0, prepend=np.zeros((1, 3)))
        for first in (1, 4) if self.tilt else ():
            R = so3.rotation_x(self.tilt)
            axes[first:], offsets[first + 1 :] = axes[first:] @ R.T, offsets[first + 1 :] @ R.T
        task = Task(axes, offsets, lower=lower, upper=upper, T=np.empty((0, 4, 4)))
        chain = chain_of(task)
        postures = q(np.random.default_rng(450), lower, upper)
        return Task(**(vars(task) | {"T": np.array([forward(chain, each) for each in postures])}))


TURN = (-180.0, 180.0)
UR5E = ArmData(
    "UR5e",
    "zyyyzy",
    [
        *((0.0, 0.0, 0.0), (0.0, 0.0, 0.1625), (0.425, 0.0, 0.1625), (0.8172, 0.0, 0.1625)),
        *((0.8172, 0.1333, 0.1625), (0.8172, 0.1333, 0.0628), (0.8172, 0.2329, 0.0628)),
    ],
    [TURN] * 6,
)
UR5E_FILE = replace(UR5E, name="UR5e, its maker's digits", tilt=2.0510349e-10)
"""Its right angles are written 1.570796327."""
KR_6 = ArmData(
    "KUKA KR 6",
    "zyyxyx",
    [
        *((0.0, 0.0, 0.0), (0.025, 0.0, 0.4), (0.48, 0.0, 0.4), (0.9, 0.0, 0.435)),
        *((0.9, 0.0, 0.435), (0.9, 0.0, 0.435), (0.98, 0.0, 0.435)),
    ],
    [
        *((-170.0, 170.0), (-190.0, 45.0), (-120.0, 156.0)),
        *((-185.0, 185.0), (-120.0, 120.0), (-350.0, 350.0)),
    ],
    elbow=float(np.arctan2(0.035, 0.42)),
)
PANDA = ArmData(
    "Panda",
    "zyzyzyz",
    [
        *((0.0, 0.0, 0.0), (0.0, 0.0, 0.333), (0.0, 0.0, 0.5), (0.0825, 0.0, 0.649)),
        *((0.0, 0.0, 0.8), (0.0, 0.0, 1.033), (0.088, 0.0, 1.033), (0.088, 0.0, 0.926)),
    ],
    np.degrees(
        [
            *((-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (0.0698, 3.0718)),
            *((-2.8973, 2.8973), (-3.7525, 0.0175), (-2.8973, 2.8973)),
        ]
    ).tolist(),
)


def random_postures(
    count: int,
) -> Callable[[np.random.Generator, FloatArray, FloatArray], FloatArray]:
    """Return a function for ``count`` postures inside the limits."""
    return lambda rng, lower, upper: rng.uniform(lower, upper, (count, len(lower)))


def singular_postures(
    count: int, elbow: float
) -> Callable[[np.random.Generator, FloatArray, FloatArray], FloatArray]:
    """Return a function for ``count`` postures with wrist, elbow or both at a singularity."""

    def postures(rng: np.random.Generator, lower: FloatArray, upper: FloatArray) -> FloatArray:
        q = rng.uniform(lower, upper, (count, len(lower)))
        off = 10.0 ** rng.uniform(-9.0, -3.0, (2, count)) * rng.choice((0.0, 1.0), (2, count))
        kind = np.arange(count) % 3
        q[kind != 1, 4] = off[0][kind != 1]
        q[kind != 0, 2] = elbow + off[1][kind != 0]
        return q

    return postures


def measured(
    arm: ArmData,
    entries: Sequence[Entry],
    task: Task,
    blocks: int,
    peers: Path,
    *,
    in_batch: bool = False,
) -> list[Row]:
    """Run the solvers on the task of ``arm`` and return their rows."""
    edges = np.linspace(0, len(task.T), blocks + 1).astype(int).tolist()
    pairs: Sequence[tuple[int, int] | None] = list(itertools.pairwise(edges))
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        task.save(folder / "task.npz")
        bench = Bench(stack, entries, folder / "task.npz", peers)
        times = bench.rounds(entries, [None] * blocks if in_batch else pairs, len(task.T))
        rows = bench.rows(entries, times, entries[0].name, chain_of(task), task)
    print(arm.name, *(f"{row.title}: {row.failed}" for row in rows if row.failed), sep="; ")
    return rows


def tables(poses: int, blocks: int, peers: Path) -> str:
    """Return all tables with the conditions of the measurement."""
    before = os.getloadavg()[0]
    parts: list[str] = []
    batch: list[Row] = []
    arms = ((UR5E, SIX), (UR5E_FILE, CLOSED), (KR_6, CLOSED), (PANDA, SEVEN))
    for arm, entries in arms:
        task = arm.task(random_postures(poses))
        rows = measured(arm, entries, task, blocks, peers)
        parts += [f"{arm.name}, one pose a call:", "", *report.single_table(rows), ""]
        if entries is not SEVEN:
            rows = measured(arm, BATCH, task, blocks, peers, in_batch=True)
            batch += [replace(row, title=f"{arm.name}: {row.title}") for row in rows]
    parts += [f"All {poses} poses in one call:", "", *report.batch_table(batch, "katana450"), ""]
    for arm in (UR5E, KR_6):
        task = arm.task(singular_postures(poses, arm.elbow))
        rows = measured(arm, CLOSED, task, blocks, peers)
        parts += [f"{arm.name} at and near singularities:", "", *report.single_table(rows), ""]
    machine = Machine(
        processor=report.processor(),
        cores=os.cpu_count() or 1,
        python=platform.python_version(),
        numpy=np.__version__,
        load=(before, os.getloadavg()[0]),
    )
    return "\n".join([report.conditions(poses, blocks, 450, machine), "", *parts]).rstrip()


def main() -> None:
    """Measure, print the tables, and write them into the documentation if requested."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--poses", type=int, default=1000, help="how many (default: %(default)s)")
    parser.add_argument("--blocks", type=int, default=10, help="rounds (default: %(default)s)")
    parser.add_argument("--peers", type=Path, default=ROOT / ".venv-bench")
    parser.add_argument("--docs", action="store_true", help=f"put the tables into {DOCS.name}")
    options = parser.parse_args()
    if not 1 <= options.blocks <= options.poses:
        parser.error("give at least one block, and no more blocks than poses")
    text = tables(options.poses, options.blocks, options.peers.absolute())
    print(text)
    if options.docs:
        report.write_between(DOCS, BEGIN, END, text)


if __name__ == "__main__":
    main()
