"""Input of all solvers of the benchmark: one arm and the same poses, passed by file.

Nothing here imports the app, so that a solver can run in an environment without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

SOLVED_POSITION = 1e-6  # m
SOLVED_ROTATION = 1e-5  # rad


@dataclass(frozen=True, eq=False)
class Task:
    """The arm, and the poses to solve for.

    Attributes:
        axes: (n, 3) unit joint directions at q = 0.
        offsets: (n + 1, 3) from the frame's origin to axis 1, from each axis to the next, from the
            last to the tool point [m].
        lower, upper: (n,) limits [rad].
        T: (N, 4, 4) poses of the tool, which is parallel to the frame at q = 0 [m].
    """

    axes: FloatArray
    offsets: FloatArray
    lower: FloatArray
    upper: FloatArray
    T: FloatArray

    def save(self, path: Path) -> None:
        """Write the task to ``path``."""
        np.savez(path, **vars(self))

    @staticmethod
    def load(path: Path) -> Task:
        """Read a task that ``save`` wrote."""
        with np.load(path) as arrays:
            return Task(**{name: arrays[name] for name in arrays.files})

    @property
    def n(self) -> int:
        """The number of axes."""
        return len(self.axes)

    @property
    def middle(self) -> FloatArray:
        """(n,) middle of the joints' range [rad], where iterative solvers start."""
        return 0.5 * (self.lower + self.upper)

    @property
    def letters(self) -> str:
        """The axes as letters, such as zyyyx.

        Raises ValueError if one is along no axis of the frame.
        """
        letters = ["xyz"[int(np.argmax(axis))] for axis in self.axes]
        if any(
            axis["xyz".index(name)] != 1.0 for axis, name in zip(self.axes, letters, strict=True)
        ):
            raise ValueError("an axis of the arm lies along none of x, y, z")
        return "".join(letters)

    def starts(self, count: int, seed: int = 0) -> list[FloatArray]:
        """Return the starts of an iterative solver: the middle, then `count` at random."""
        rng = np.random.default_rng(seed)
        return [self.middle, *rng.uniform(self.lower, self.upper, (count, self.n))]


def urdf(task: Task) -> str:
    """Return the arm as URDF, with the links ``base`` and ``tool`` at its ends."""
    names = ["base", *(f"link{number + 1}" for number in range(task.n)), "tool"]
    joints = "".join(
        f'<joint name="joint{number + 1}" type="revolute"><parent link="{names[number]}"/>'
        f'<child link="{names[number + 1]}"/><origin xyz="{numbers_text(task.offsets[number])}"/>'
        f'<axis xyz="{numbers_text(task.axes[number])}"/>'
        f'<limit lower="{float(task.lower[number])!r}" upper="{float(task.upper[number])!r}" '
        f'velocity="1" effort="1"/></joint>'
        for number in range(task.n)
    )
    links = "".join(f'<link name="{name}"/>' for name in names)
    return (
        f'<robot name="arm">{links}{joints}<joint name="end" type="fixed">'
        f'<parent link="{names[-2]}"/><child link="tool"/>'
        f'<origin xyz="{numbers_text(task.offsets[-1])}"/></joint></robot>'
    )


def numbers_text(values: FloatArray) -> str:
    """Return the values with all their digits, separated by blanks."""
    return " ".join(repr(float(value)) for value in values)


class Solver(Protocol):
    """One solver. Only `solve` is timed; it returns the value of the library unchanged."""

    package: str

    def solve(self, T: FloatArray) -> Any:
        """Return the library's answer for the pose ``T`` (4, 4)."""
        ...

    def joints(self, found: Any) -> FloatArray:
        """Return every exact answer (k, n) [rad] in the result of `solve`; k may be 0."""
        ...
