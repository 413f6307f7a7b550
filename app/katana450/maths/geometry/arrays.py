"""Checked conversion of input values to float arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError

_HINT = "give plain finite numbers"

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]


def real_array(value: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    """Return a float64 copy of `value`; NaN and infinity are allowed.

    `name` names the value in error messages. Raises InputError when the value does not consist of
    real numbers or has another shape.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is not a regular array: {error}.") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} holds {array.dtype} values; {_HINT}.")
    if array.shape != shape:
        raise InputError(f"{name} has shape {array.shape}; it must be {shape}.")
    return np.array(array, dtype=np.float64)


def finite_array(value: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    """Return a float64 copy of `value`, made of finite numbers.

    Raises InputError as `real_array`, and for NaN or infinity.
    """
    result = real_array(value, shape, name)
    if not np.isfinite(result).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(result))[0])
        place = f" at {list(where)}" if where else ""
        raise InputError(f"{name} has {result[where]}{place}; {_HINT}.")
    return result


def frozen(values: npt.ArrayLike) -> FloatArray:
    """Return a read-only float64 copy of `values`."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
