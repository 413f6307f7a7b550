"""What every solver of the benchmark is given: one arm and the same poses, handed over by file.

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

    axes: (5, 3) unit joint directions at q = 0. offsets: (6, 3) from the frame's origin to axis 1,
    from each axis to the next, from axis 5 to the tool point [m]. lower, upper: (5,) limits [rad].
    T: (N, 4, 4) poses of the tool, which is parallel to the frame at q = 0 [m].
    """

    axes: FloatArray
    offsets: FloatArray
    lower: FloatArray
    upper: FloatArray
    T: FloatArray

    def save(self, path: Path) -> None:
        np.savez(path, **vars(self))

    @staticmethod
    def load(path: Path) -> Task:
        with np.load(path) as arrays:
            return Task(**{name: arrays[name] for name in arrays.files})

    @property
    def middle(self) -> FloatArray:
        """(5,) the middle of the joints' range, where iterative solvers start."""
        return 0.5 * (self.lower + self.upper)

    @property
    def letters(self) -> str:
        """The axes as letters, such as zyyyx; ValueError for one along no axis of the frame."""
        letters = ["xyz"[int(np.argmax(axis))] for axis in self.axes]
        if any(
            axis["xyz".index(name)] != 1.0 for axis, name in zip(self.axes, letters, strict=True)
        ):
            raise ValueError("an axis of the arm lies along none of x, y, z")
        return "".join(letters)

    def starts(self, count: int, seed: int = 0) -> list[FloatArray]:
        """Where an iterative solver starts and starts again: the middle, then `count` at random."""
        rng = np.random.default_rng(seed)
        return [self.middle, *rng.uniform(self.lower, self.upper, (count, 5))]


class Solver(Protocol):
    """One solver. Only `solve` is timed; it returns whatever the library returns."""

    package: str

    def solve(self, T: FloatArray) -> Any: ...

    def joints(self, found: Any) -> FloatArray:
        """(k, 5) every exact answer in what `solve` returned [rad]; k may be 0."""
        ...
