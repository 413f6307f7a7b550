"""Rounded and distinct rows of coordinates for text formats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, IntArray


def distinct_rows(parts: Sequence[FloatArray], digits: int) -> tuple[FloatArray, IntArray]:
    """Return the distinct rounded rows of ``parts``, and for every row its index in them.

    Raises InputError for numbers that are not finite.
    """
    rows = np.round(np.concatenate(parts), digits) + 0.0
    if not np.isfinite(rows).all():
        raise InputError("A shape has coordinates that are not finite numbers.")
    found, index = np.unique(rows, axis=0, return_inverse=True)
    return found, index.reshape(-1).astype(np.int64)
