"""The benchmark's end of the pipe to a solver in a separate process."""

from __future__ import annotations

import json
import os
import select
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from benchmarks.kinematics_task import FloatArray

ANSWER_TIMEOUT = 300.0  # s; the slowest solver takes a few seconds per block


class SolverError(Exception):
    """A solver could not be started or stopped answering; the message says why."""


class SolverProcess:
    """A running solver. Numerical libraries get one thread: a solve is too short for more."""

    def __init__(self, python: Path, name: str, task_file: Path, root: Path) -> None:
        threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
        # Closing stdin ends the process, so __exit__ closes it.
        self._process = subprocess.Popen(
            [str(python), "-m", "benchmarks.kinematics_worker", name, str(task_file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=root,
            env=os.environ | threads,
        )
        try:
            self.version = str(self._answer()["version"])
        except SolverError:
            self._end()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._end()

    def solve(self, first: int, last: int) -> float:
        """Return the seconds to solve the poses from ``first`` to before ``last`` one by one."""
        return float(self._ask({"solve": [first, last]})["seconds"])

    def batch(self) -> float:
        """Return the seconds to solve all poses in one call."""
        return float(self._ask({"batch": True})["seconds"])

    def answers(self) -> list[FloatArray]:
        """Return the last answers (k, 5) [rad] for each pose."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "answers.npz"
            self._ask({"save": str(path)})
            with np.load(path) as arrays:
                q, counts = arrays["q"], arrays["counts"]
        return np.split(q, np.cumsum(counts)[:-1])

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        try:
            print(json.dumps(request), file=self._process.stdin, flush=True)
        except BrokenPipeError:
            raise SolverError("its process has ended") from None
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], ANSWER_TIMEOUT)
        if not ready:
            raise SolverError(f"no answer within {ANSWER_TIMEOUT:.0f} s")
        line = self._process.stdout.readline()
        if not line:
            raise SolverError(f"its process ended with status {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        if "failed" in answer:
            raise SolverError(str(answer["failed"]))
        return answer

    def _end(self) -> None:
        self._process.kill()
        self._process.communicate()
