"""What a command is made of, checked: numbers and vectors of numbers."""

from __future__ import annotations

import math

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen


def check_finite(what: str, value: object) -> None:
    """InputError for what is no finite number; ``what`` says what it should have been."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{what} has to be a finite number, not {value!r}.")


def vector(what: str, value: object, size: int | None) -> FloatArray:
    """A copy of ``value`` (size,) that cannot be written to; any size above 0 where that is None.

    Raises InputError for another shape and for what is not finite; ``what`` says what it is.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what} has to be a list of numbers, not {value!r}.") from None
    if array.ndim != 1 or array.size == 0 or (size is not None and array.size != size):
        wanted = "a flat list" if size is None else f"{size} numbers"
        raise InputError(f"{what} has to be {wanted}, not an array of shape {array.shape}.")
    if not np.isfinite(array).all():
        raise InputError(f"{what} has to be finite: {array.tolist()}.")
    return frozen(array)
