"""Inverse kinematics of the Katana450: the app beside other libraries, and beside plain C.

Every solver gets the same seeded poses, those of the tool at random joint angles inside the limits.
Each runs in a separate process, and the peers in separate environments. All solve the same poses
block by block, one solver at a time in random order, so that all meet the same conditions. A block
is repeated for a while, and its quickest pass counts. Ratios are computed within blocks.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import platform
import random
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import kinematics_report as report
from benchmarks.kinematics_process import SolverError, SolverProcess
from benchmarks.kinematics_quality import quality
from benchmarks.kinematics_report import Machine, Row, Tables
from benchmarks.kinematics_task import FloatArray, Task
from benchmarks.peers import prepare
from katana450.arm.robot.loader import load
from katana450.maths.geometry import screws
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs" / "benchmarks.md"
OWN = "katana450"
FLOOR = "floor"


@dataclass(frozen=True)
class Entry:
    """A solver of the benchmark: its name, its title for readers, and the peer that it needs."""

    name: str
    title: str
    peer: str | None = None


ONE_BY_ONE = (
    Entry(OWN, "katana450 `arm.ik`"),
    Entry("eaik", "EAIK", "EAIK"),
    Entry("roboticstoolbox", "roboticstoolbox `ik_LM`, limits kept", "roboticstoolbox-python"),
    Entry("roboticstoolbox-free", "roboticstoolbox `ik_LM`", "roboticstoolbox-python"),
    Entry("pinocchio", "pinocchio, closed loop", "pin"),
    Entry("mink", "mink, limits kept", "mink"),
    Entry("mink-free", "mink", "mink"),
    Entry("ikpy", "ikpy, limits kept", "ikpy"),
)
BATCH = (
    Entry(FLOOR, "C, `-O3`"),
    Entry(OWN, "katana450 `arm.ik`"),
    Entry("eaik", "EAIK, 1 thread", "EAIK"),
    Entry("eaik-threads", f"EAIK, {os.cpu_count()} threads", "EAIK"),
)


def seeded_task(poses: int, seed: int) -> tuple[Chain, Task]:
    """Return the arm of the URDF with its default tool, and a task of `poses` reachable poses."""
    chain = load().require_arm().chain
    q = np.random.default_rng(seed).uniform(chain.lower, chain.upper, (poses, chain.n))
    points = np.array([screws.point_on(S) for S in chain.S.T] + [chain.M[:3, 3]])
    task = Task(
        axes=chain.S[:3].T,
        offsets=np.diff(points, axis=0, prepend=np.zeros((1, 3))),
        lower=chain.lower,
        upper=chain.upper,
        T=np.array([forward(chain, each) for each in q]),
    )
    return chain, task


class Bench:
    """All running solvers, and the reasons of those that failed."""

    def __init__(self, stack: ExitStack, entries: Sequence[Entry], task_file: Path, peers: Path):
        self.failed: dict[str, str] = {}
        self.running: dict[str, SolverProcess] = {}
        pythons: dict[str, Path | str] = {}
        for entry in entries:
            if entry.name in self.running or entry.name in self.failed:
                continue
            if entry.peer is not None and entry.peer not in pythons:
                print(f"Preparing {entry.peer} ...", file=sys.stderr)
                pythons[entry.peer] = prepare(peers, entry.peer)
            python = Path(sys.executable) if entry.peer is None else pythons[entry.peer]
            if isinstance(python, str):
                self.failed[entry.name] = f"could not be installed: {python}"
                continue
            try:
                process = SolverProcess(python, entry.name, task_file, ROOT)
            except SolverError as error:
                self.failed[entry.name] = f"could not be started: {error}"
            else:
                self.running[entry.name] = stack.enter_context(process)

    def seconds(self, entry: Entry, block: tuple[int, int] | None) -> float:
        """Return the time [s] of one block, or of all poses in one call; NaN after a failure."""
        process = self.running.get(entry.name)
        if process is None:
            return float("nan")
        try:
            return process.batch() if block is None else process.solve(*block)
        except SolverError as error:
            del self.running[entry.name]
            self.failed[entry.name] = f"failed while solving: {error}"
            return float("nan")

    def rounds(
        self, entries: Sequence[Entry], blocks: Sequence[tuple[int, int] | None], poses: int
    ) -> dict[str, FloatArray]:
        """Return the microseconds per pose of each entry in each block."""
        taken: dict[str, list[float]] = {entry.name: [] for entry in entries}
        for number, block in enumerate(blocks, start=1):
            print(f"Round {number} of {len(blocks)} ...", file=sys.stderr)
            count = poses if block is None else block[1] - block[0]
            for entry in random.sample(entries, len(entries)):
                taken[entry.name].append(1e6 * self.seconds(entry, block) / count)
        return {name: np.array(times) for name, times in taken.items()}

    def rows(
        self,
        entries: Sequence[Entry],
        times: dict[str, FloatArray],
        against: str,
        chain: Chain,
        task: Task,
    ) -> list[Row]:
        """Return a row for each entry; failed ones have the reason."""
        rows = []
        reference = times.get(against, np.array(np.nan))
        for entry in entries:
            if entry.name in self.failed:
                rows.append(Row(entry.title, failed=self.failed[entry.name]))
                continue
            process = self.running[entry.name]
            rows.append(
                Row(
                    entry.title,
                    version=process.version,
                    microseconds=times[entry.name],
                    ratios=times[entry.name] / reference,
                    quality=quality(chain, task.T, process.answers()),
                )
            )
        return rows


def measure(poses: int, blocks: int, seed: int, peers: Path, names: Sequence[str]) -> Tables:
    """Run all solvers and return the tables."""
    chain, task = seeded_task(poses, seed)
    single = [entry for entry in ONE_BY_ONE if entry.name in names]
    batch = [entry for entry in BATCH if entry.name in names]
    edges = np.linspace(0, poses, blocks + 1).astype(int).tolist()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        task.save(folder / "task.npz")
        bench = Bench(stack, [*single, *batch], folder / "task.npz", peers)
        before = os.getloadavg()[0]
        pairs = list(itertools.pairwise(edges))
        times = bench.rounds(single, pairs, poses)
        one_by_one = bench.rows(single, times, OWN, chain, task)
        times = bench.rounds(batch, [None] * blocks, poses)
        in_batch = bench.rows(batch, times, FLOOR, chain, task)
        load_average = (before, os.getloadavg()[0])
    machine = Machine(
        processor=report.processor(),
        cores=os.cpu_count() or 1,
        python=platform.python_version(),
        numpy=np.__version__,
        load=load_average,
    )
    return Tables(poses, blocks, seed, machine, one_by_one, in_batch)


def main() -> None:
    """Measure, print the tables, and write them to files if requested."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = list(dict.fromkeys(entry.name for entry in (*ONE_BY_ONE, *BATCH)))
    parser.add_argument("--poses", type=int, default=2000, help="how many (default: %(default)s)")
    parser.add_argument("--blocks", type=int, default=20, help="rounds (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=450, help="of the poses (default: %(default)s)")
    parser.add_argument(
        "--peers",
        type=Path,
        default=ROOT / ".venv-bench",
        help="where the peers' environments are, or are made (default: %(default)s)",
    )
    parser.add_argument(
        "--solvers", nargs="+", choices=known, default=known, metavar="NAME", help=", ".join(known)
    )
    parser.add_argument("--json", type=Path, help="file for the figures and every single time")
    parser.add_argument(
        "--docs", action="store_true", help=f"put the tables into {DOCS.relative_to(ROOT)}"
    )
    options = parser.parse_args()
    if not 1 <= options.blocks <= options.poses:
        parser.error("give at least one block, and no more blocks than poses")
    tables = measure(
        options.poses, options.blocks, options.seed, options.peers.absolute(), options.solvers
    )
    print(report.text(tables))
    if options.json:
        options.json.write_text(
            json.dumps(report.record(tables), indent=1) + "\n", encoding="utf-8"
        )
    if options.docs:
        report.write_into(DOCS, tables)


if __name__ == "__main__":
    main()
