"""Exact statistics of datasets: over all frames, and over all pixels of all pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Quantiles by their names."""

LEVELS = 256
"""Number of levels of a colour."""

Statistics = dict[str, list[Any]]
"""Statistics of a feature by their names."""


def column_statistics(values: npt.NDArray[Any]) -> Statistics:
    """Return the statistics of ``values`` (N, n) over their N rows, each a list of n numbers.

    ``std`` is that of the rows themselves, with the divisor N. Quantiles between two values are
    interpolated. ``count`` is a list of one number.
    """
    numbers = np.asarray(values, dtype=np.float64)
    found = {
        "min": numbers.min(axis=0),
        "max": numbers.max(axis=0),
        "mean": numbers.mean(axis=0),
        "std": numbers.std(axis=0),
    }
    quantiles = np.quantile(numbers, tuple(QUANTILES.values()), axis=0)
    found.update(zip(QUANTILES, quantiles, strict=True))
    lists: Statistics = {name: value.tolist() for name, value in found.items()}
    return {**lists, "count": [len(numbers)]}


class PixelCounts:
    """Counts of the levels of red, green and blue in pictures, from which statistics follow."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, LEVELS), dtype=np.int64)
        self._pictures = 0

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Count the pixels of ``picture`` (height, width, 3)."""
        for colour in range(3):
            self._counts[colour] += np.bincount(picture[:, :, colour].ravel(), minlength=LEVELS)
        self._pictures += 1

    def merge(self, other: PixelCounts) -> None:
        """Add the counts of ``other``."""
        self._counts += other._counts
        self._pictures += other._pictures

    @property
    def statistics(self) -> Statistics:
        """The statistics of all pixels, each (3, 1, 1) from 0 to 1; ``count`` is of pictures."""
        levels = np.arange(LEVELS) / (LEVELS - 1)
        total = self._counts.sum(axis=1)
        mean = self._counts @ levels / total
        spread = np.array(
            [
                counts @ (levels - middle) ** 2
                for counts, middle in zip(self._counts, mean, strict=True)
            ]
        )
        found = {
            "min": [levels[np.flatnonzero(counts)[0]] for counts in self._counts],
            "max": [levels[np.flatnonzero(counts)[-1]] for counts in self._counts],
            "mean": mean,
            "std": np.sqrt(spread / total),
        }
        for name, fraction in QUANTILES.items():
            found[name] = [_quantile(counts, fraction) for counts in self._counts]
        lists: Statistics = {
            name: np.asarray(value, dtype=np.float64).reshape(3, 1, 1).tolist()
            for name, value in found.items()
        }
        return {**lists, "count": [self._pictures]}


def _quantile(counts: npt.NDArray[np.int64], fraction: float) -> float:
    """Return the quantile [0..1] of the levels that were counted, as numpy interpolates it."""
    until = np.cumsum(counts)
    place = fraction * (int(until[-1]) - 1)
    low = int(place)
    ends: FloatArray = np.searchsorted(until, (low, low + 1), side="right").clip(0, LEVELS - 1) / (
        LEVELS - 1
    )
    return float(ends[0] + (place - low) * (ends[1] - ends[0]))
