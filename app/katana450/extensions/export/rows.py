"""Rows of coordinates as text formats write them: rounded, and each once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, IntArray


def distinct_rows(parts: Sequence[FloatArray], digits: int) -> tuple[FloatArray, IntArray]:
    """Return the rows of ``parts`` rounded, each once, and the index of every given row in them.

    Raises InputError for numbers that are not finite.
    """
    rows = np.round(np.concatenate(parts), digits) + 0.0
    if not np.isfinite(rows).all():
        raise InputError("A shape has coordinates that are no finite numbers.")
    found, index = np.unique(rows, axis=0, return_inverse=True)
    return found, index.reshape(-1).astype(np.int64)
