"""Checks of the numbers and vectors in commands."""

from __future__ import annotations

import math

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen


def check_finite(what: str, value: object) -> None:
    """Raise InputError unless ``value`` is a finite number; ``what`` names it in the message."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{what} must be a finite number, not {value!r}.")


def vector(what: str, value: object, size: int | None) -> FloatArray:
    """Return a read-only copy of ``value`` (size,); any size above 0 if ``size`` is None.

    Raises InputError for another shape and for numbers that are not finite; ``what`` names the
    vector in the message.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what} must be a list of numbers, not {value!r}.") from None
    if array.ndim != 1 or array.size == 0 or (size is not None and array.size != size):
        expected = "a flat list" if size is None else f"{size} numbers"
        raise InputError(f"{what} must be {expected}, not an array of shape {array.shape}.")
    if not np.isfinite(array).all():
        raise InputError(f"{what} must be finite, not {array.tolist()}.")
    return frozen(array)
