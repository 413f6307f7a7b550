"""Solvers for the benchmark: the app's own inverse kinematics, and the same closed form in C."""

from __future__ import annotations

import ctypes
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kinematics_task import FloatArray, Task, urdf
from katana450 import tolerances
from katana450.extensions.general_arms.links import links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.library.arm import load
from katana450.maths.geometry import screws
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain

FLOOR_SOURCE = Path(__file__).with_name("kinematics_floor.c")
FLOOR_FLAGS = ("-O3", "-shared", "-fPIC")


def chain_of(task: Task) -> Chain:
    """Return the task's arm as a chain of the app."""
    points = np.cumsum(task.offsets, axis=0)
    M = np.eye(4)
    M[:3, 3] = points[-1]
    S = [screws.revolute(axis, r) for axis, r in zip(task.axes, points[:-1], strict=True)]
    return Chain(
        M=M,
        S=np.column_stack(S),
        lower=task.lower,
        upper=task.upper,
        speed=np.ones(task.n),
        names=tuple(f"joint{number + 1}" for number in range(task.n)),
    )


class Public:
    """`Arm.ik` of the arm in a URDF, and the reading of its first solution."""

    package = "katana450"

    def __init__(self, task: Task) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(urdf(task), encoding="utf-8")
            self._arm = load(path, tool="tool", frame="base")

    def solve(self, T: FloatArray) -> Any:
        """Return all solutions for the pose ``T`` (4, 4), the first of which is read."""
        solutions = self._arm.ik(T)
        return solutions, next(iter(solutions)).q

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (k, n) [rad] of the exact solutions in ``found``."""
        exact = [solution.q for solution in found[0] if solution.exact]
        return np.array(exact).reshape(-1, self._arm.n)

    def solve_batch(self, T: FloatArray) -> Any:
        """Return all solutions for the poses ``T`` (N, 4, 4), whose angles are read."""
        solutions = self._arm.ik(T)
        return solutions, solutions.q

    def joints_batch(self, found: Any) -> list[FloatArray]:
        """Return the joint angles (k, n) [rad] of the exact solutions of each pose in ``found``."""
        solutions, q = found
        exact = solutions.position_error <= tolerances.SAME_POSITION
        exact &= solutions.rotation_error <= tolerances.SAME_ROTATION
        return [angles[chosen] for angles, chosen in zip(q, exact, strict=True)]


class Search:
    """`Numerical`: one posture inside the limits of an arm of any kind."""

    package = "katana450"

    def __init__(self, task: Task) -> None:
        chain = chain_of(task)
        self._search = Numerical(chain, links_of(chain, exact=False))
        self._search.solve(task.T[0])

    def solve(self, T: FloatArray) -> Any:
        """Return joint angles (n,) [rad] for the pose ``T`` (4, 4)."""
        return self._search.solve(T)

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (1, n) [rad] of ``found``."""
        return np.array([found])


class Floor:
    """`kinematics_floor.c`, compiled here, on one thread."""

    package = "cc"

    def __init__(self, task: Task) -> None:
        arm = arm_of(chain_of(task))
        self._arm = [np.array((arm.l1, arm.l2, arm.l3)), task.lower.copy(), task.upper.copy()]
        self._function = _compiled().inverse_batch
        double, byte = (np.ctypeslib.ndpointer(dtype, flags="C") for dtype in (float, np.uint8))
        self._function.argtypes = [
            *(double, double, double, ctypes.c_double),
            *(double, ctypes.c_int64, double, byte),
        ]
        self._function.restype = None

    def solve_batch(self, T: FloatArray) -> Any:
        """Return all solutions (N, 4, 5) for the poses ``T`` (N, 4, 4)."""
        q, inside = np.empty((len(T), 4, 5)), np.empty((len(T), 4), dtype=np.uint8)
        self._function(*self._arm, tolerances.LIMIT_SLACK, T, len(T), q, inside)
        return q

    def joints_batch(self, found: Any) -> list[FloatArray]:
        """Return the joint angles (4, 5) [rad] of each pose in ``found``."""
        return list(found)


def compiler() -> str:
    """Return the path of the C compiler of this machine. Raises RuntimeError if there is none."""
    found = shutil.which("cc")
    if found is None:
        raise RuntimeError("there is no C compiler `cc` on this machine")
    return found


def compiler_version() -> str:
    """Return the version of the C compiler."""
    done = subprocess.run([compiler(), "--version"], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[0]


def _compiled() -> ctypes.CDLL:
    with tempfile.TemporaryDirectory() as folder:
        suffix = ".dylib" if platform.system() == "Darwin" else ".so"
        library = Path(folder) / f"floor{suffix}"
        command = [compiler(), *FLOOR_FLAGS, "-o", str(library), str(FLOOR_SOURCE), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{FLOOR_SOURCE.name} does not compile: {done.stderr.strip()}")
        return ctypes.CDLL(str(library))
