"""Numbers, vectors and matrices in acts: their types, their checks, and how JSON becomes them."""

from __future__ import annotations

import math
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from katana450.arm.control.commands.act import MAX_JOINTS
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen


def _rows(low: int, high: int, items: dict[str, Any] | None = None) -> Meta:
    """Return the JSON Schema of ``low`` to ``high`` numbers, or of as many rows like ``items``."""
    shape = {"type": "array", "items": items or {"type": "number"}}
    return Meta(extra_json_schema={**shape, "minItems": low, "maxItems": high})


_ROW3, _ROW4 = _rows(3, 3).extra_json_schema, _rows(4, 4).extra_json_schema

JointVector = Annotated[FloatArray, _rows(1, MAX_JOINTS)]
"""(n,) one number a joint: [rad], or [m] for joints that slide, or their rates."""

ToolNumbers = Annotated[FloatArray, _rows(5, 6)]
"""(5,) x, y, z, pitch and roll of the tool; (6,) x, y, z and a rotation about each axis."""

ToolRates = Annotated[FloatArray, _rows(5, 7)]
"""(5,) or (6,) as `ToolNumbers`; (7,) the arm angle follows."""

Point = Annotated[FloatArray, _rows(3, 3)]
"""(3,) [m]."""

Rotation = Annotated[FloatArray, _rows(3, 3, _ROW3)]
"""(3, 3) a rotation."""

Transform = Annotated[FloatArray, _rows(4, 4, _ROW4)]
"""(4, 4) a rotation and a translation [m]."""


def decoded_field(kind: Any, value: Any) -> Any:
    """Return the array of the numbers ``value`` in a JSON message, the ``dec_hook`` of msgspec.

    Raises ValueError if ``value`` is neither a list of numbers nor a list of rows of them.
    """
    if kind is not FloatArray:
        raise NotImplementedError(f"No message has a field of the type {kind}.")
    rows = isinstance(value, list) and bool(value) and isinstance(value[0], list)
    return np.array(msgspec.convert(value, list[list[float]] if rows else list[float]))


def field_schema(kind: Any) -> dict[str, Any]:
    """Return the JSON Schema of an array of any size, the ``schema_hook`` of msgspec."""
    if kind is not FloatArray:
        raise NotImplementedError(f"No message has a field of the type {kind}.")
    return {}


def encoded_field(value: Any) -> Any:
    """Return a number or an array of numpy as JSON values, the ``enc_hook`` of msgspec."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"A value of type {type(value).__name__} cannot be sent: {value!r}")


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
