"""One solver of the benchmark in a separate process, at the other end of a pipe.

A line `{"solve": [first, last]}` or `{"batch": true}` is answered by a line with the time it took.
At the end `{"save": path}` writes the answers. Each line is JSON. Output of libraries goes to
stderr.
"""

from __future__ import annotations

import gc
import json
import os
import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.kinematics_task import FloatArray, Task

# One block is solved repeatedly for at least this time, and the quickest pass counts.
MIN_TIME = 0.02  # s


def _own(name: str) -> Callable[[Task], Any]:
    # Imported here, because the environments of the peers do not have the app.
    from benchmarks import kinematics_own

    solver: Callable[[Task], Any] = getattr(kinematics_own, name)
    return solver


def _peer(name: str, **options: Any) -> Callable[[Task], Any]:
    from benchmarks import kinematics_peers

    return partial(getattr(kinematics_peers, name), **options)


SOLVERS: dict[str, Callable[[], Callable[[Task], Any]]] = {
    "katana450": lambda: _own("Public"),
    "katana450-numerical": lambda: _own("Search"),
    "floor": lambda: _own("Floor"),
    "eaik": lambda: _peer("Eaik"),
    "eaik-threads": lambda: _peer("Eaik", workers=os.cpu_count() or 1),
    "ik-geo": lambda: _peer("IkGeo"),
    "trac-ik": lambda: _peer("TracIk"),
    "roboticstoolbox": lambda: _peer("RoboticsToolbox", limits=True),
    "roboticstoolbox-free": lambda: _peer("RoboticsToolbox", limits=False),
    "pinocchio": lambda: _peer("Pinocchio"),
    "mink": lambda: _peer("Mink", limits=True),
    "mink-free": lambda: _peer("Mink", limits=False),
    "ikpy": lambda: _peer("Ikpy"),
}


class Bench:
    """A solver, its poses, and its answers so far."""

    def __init__(self, solver: Any, task: Task) -> None:
        self._solver = solver
        # Each pose is a contiguous array, as a caller would have it.
        self._poses = [np.ascontiguousarray(T) for T in task.T]
        self._batch = np.ascontiguousarray(task.T)
        self._answers: list[FloatArray] = [np.empty((0, task.n))] * len(self._poses)

    def solve(self, first: int, last: int) -> float:
        """Return the seconds of the quickest pass over the poses from `first` to before `last`."""
        solve, poses = self._solver.solve, self._poses[first:last]
        quickest, found = _quickest(lambda: [solve(T) for T in poses])
        self._answers[first:last] = [self._solver.joints(each) for each in found]
        return quickest

    def solve_batch(self) -> float:
        """Return the seconds for all poses in one call."""
        quickest, found = _quickest(lambda: self._solver.solve_batch(self._batch))
        self._answers = self._solver.joints_batch(found)
        return quickest

    def save(self, path: Path) -> None:
        """Write all answers as one array q (K, n), with the number of answers of each pose."""
        counts = np.array([len(q) for q in self._answers])
        np.savez(path, q=np.concatenate(self._answers), counts=counts)


def _quickest(run: Callable[[], Any]) -> tuple[float, Any]:
    """Return the minimum seconds of several runs within MIN_TIME, and the first result."""
    gc.collect()
    gc.disable()
    try:
        start = perf_counter()
        result = run()
        quickest = spent = perf_counter() - start
        while spent < MIN_TIME:
            start = perf_counter()
            run()
            once = perf_counter() - start
            quickest, spent = min(quickest, once), spent + once
    finally:
        gc.enable()
    return quickest, result


def _version(package: str) -> str:
    if package == "cc":
        from benchmarks.kinematics_own import compiler_version

        return compiler_version()
    try:
        return version(package)
    except PackageNotFoundError:
        return "this tree"


def main(name: str, task_file: str) -> int:
    """Answer requests until stdin ends."""
    # Only answers may go to the pipe, so the output of libraries goes to stderr.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def say(answer: dict[str, Any]) -> None:
        print(json.dumps(answer), file=answers, flush=True)

    task = Task.load(Path(task_file))
    try:
        solver = SOLVERS[name]()(task)
        bench = Bench(solver, task)
    except Exception as error:
        say({"failed": f"{type(error).__name__}: {error}"})
        return 1
    say({"version": _version(solver.package), "numpy": np.__version__})
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if "save" in request:
                bench.save(Path(request["save"]))
                say({})
            elif "batch" in request:
                say({"seconds": bench.solve_batch()})
            else:
                say({"seconds": bench.solve(*request["solve"])})
        except Exception as error:
            say({"failed": f"{type(error).__name__}: {error}"})
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
