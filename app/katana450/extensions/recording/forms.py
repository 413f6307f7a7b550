"""Text forms of numbers and arrays, exact to the bit, and the error of an invalid form.

JSON has no infinity and no NaN, so these are texts. A finite number is written with as many digits
as it needs to be read back exactly.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import msgspec
import numpy as np

from katana450.errors import InputError

MAX_ITEMS = 1_000_000
"""Maximum number of items of an array or a tuple."""

MAX_INT = 2**63 - 1
"""Largest whole number: JSON readers of other languages take no larger ones exactly either."""

QUIET_NAN = struct.pack(">d", math.nan)
NOT_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


class FormError(InputError):
    """A value has no text form, or a text form does not give a value.

    Attributes:
        text: the reason.
        place: names of the fields, and numbers of the items, that lead to the value.
    """

    def __init__(self, text: str, place: tuple[str | int, ...] = ()) -> None:
        """State the reason ``text`` and the ``place`` of the value."""
        self.text, self.place = text, place
        where = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
        super().__init__(f"{where.removeprefix('.')}: {text}" if place else text)

    def within(self, step: str | int) -> FormError:
        """Return the same error, with its value in the field or item ``step`` of another."""
        return FormError(self.text, (step, *self.place))


def shown(form: object) -> str:
    """Return ``form`` for an error message, shortened."""
    text = repr(form)
    return text if len(text) <= 60 else f"{text[:60]}..."


MAX_TEXT_BYTES = 32_000_000
"""Maximum length of the text of one value; the longest plan of an hour has a tenth of it."""


def json_text(form: Any) -> bytes:
    """Return ``form`` as JSON."""
    return msgspec.json.encode(form)


def json_form(text: bytes | str, kind: Any = Any) -> Any:
    """Return the form in the JSON ``text``, checked to be of ``kind``. Raises FormError."""
    if len(text) > MAX_TEXT_BYTES:
        raise FormError(f"it has {len(text)} bytes, more than {MAX_TEXT_BYTES}")
    try:
        return msgspec.json.decode(text, type=kind)
    except msgspec.ValidationError as error:
        raise FormError(str(error)) from None
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise FormError(f"it is not JSON: {error}") from None


def number_form(value: Any) -> float | int | str:
    """Return the form of a number. Raises FormError for types that JSON cannot give back."""
    if isinstance(value, float):
        real = float(value)
        if math.isfinite(real):
            return real
        if math.isinf(real):
            return "inf" if real > 0.0 else "-inf"
        bits = struct.pack(">d", real)
        return "nan" if bits == QUIET_NAN else f"nan:{bits.hex()}"
    if isinstance(value, bool):
        return value
    if isinstance(value, int | np.integer) and abs(int(value)) <= MAX_INT:
        return int(value)
    raise FormError(f"{shown(value)} is not a number of 64 bits")


def number(form: Any) -> float | int:
    """Return the number of ``form``; a whole number stays one. Raises FormError."""
    if isinstance(form, float):
        return form
    if isinstance(form, int):
        if abs(form) > MAX_INT:
            raise FormError(f"{shown(form)} is not a number of 64 bits")
        return form
    if isinstance(form, str):
        if form in NOT_FINITE:
            return NOT_FINITE[form]
        kind, _, digits = form.partition(":")
        try:
            value = float(struct.unpack(">d", bytes.fromhex(digits))[0])
        except (ValueError, struct.error):
            value = 0.0
        if kind == "nan" and math.isnan(value):
            return value
    raise FormError(f"{shown(form)} is not a number")


def array_form(value: np.ndarray[Any, Any]) -> Any:
    """Return the form of an array: rows of numbers, or an object if these do not tell all.

    The object has the shape, the type and the steps of the memory, because sums of products can
    be rounded otherwise for another order of the same numbers in memory. Raises FormError.
    """
    if value.dtype == np.float64 and value.flags.c_contiguous and value.size and value.ndim:
        rows = value.tolist()
        return rows if np.isfinite(value).all() else _mapped(rows)
    if value.dtype not in (np.float64, np.int64):
        raise FormError(f"an array of {value.dtype} has no form")
    steps = [step // value.itemsize for step in value.strides]
    if min(steps, default=0) < 0:
        raise FormError("an array that runs backwards in memory has no form")
    numbers = [number_form(item) for item in value.ravel(order="C").tolist()]
    kind = value.dtype.name
    return {"shape": list(value.shape), "type": kind, "steps": steps, "data": numbers}


def _mapped(rows: Any) -> Any:
    return [_mapped(row) for row in rows] if isinstance(rows, list) else number_form(rows)


def array(form: Any) -> np.ndarray[Any, Any]:
    """Return the array of ``form``, read-only. Raises FormError."""
    values = _of_rows(form) if isinstance(form, list) else _of_object(form)
    values.setflags(write=False)
    return values


def _of_rows(form: list[Any]) -> np.ndarray[Any, Any]:
    shape: list[int] = []
    row: Any = form
    while isinstance(row, list):
        shape.append(len(row))
        row = row[0] if row else None
    if not 0 < math.prod(shape) <= MAX_ITEMS:
        raise FormError(f"an array of the shape {shown(tuple(shape))} is empty or too large")
    flat = form
    for length in shape[1:]:
        if not all(isinstance(row, list) and len(row) == length for row in flat):
            raise FormError("the rows of an array have different lengths")
        flat = [item for row in flat for item in row]
    numbers = [float(number(item)) for item in flat]
    return np.array(numbers, dtype=np.float64).reshape(shape)


def _of_object(form: Any) -> np.ndarray[Any, Any]:
    if not isinstance(form, dict) or set(form) != {"shape", "type", "steps", "data"}:
        raise FormError(f"{shown(form)} is not an array")
    shape, steps, data, kind = form["shape"], form["steps"], form["data"], form["type"]
    for numbers in (shape, steps):
        if not isinstance(numbers, list) or not all(type(n) is int and n >= 0 for n in numbers):
            raise FormError("shape and steps of an array are whole numbers from 0")
    if kind not in ("float64", "int64") or len(shape) != len(steps) or not isinstance(data, list):
        raise FormError(f"{shown(form)} is not an array")
    room = 1 + sum((n - 1) * step for n, step in zip(shape, steps, strict=True) if n)
    count = math.prod(shape)
    if len(shape) > 8 or count != len(data) or max(count, room) > MAX_ITEMS:
        raise FormError(f"an array of the shape {shown(shape)} does not have {len(data)} items")
    base = np.zeros(room, dtype=kind)
    values = np.lib.stride_tricks.as_strided(
        base, shape, [step * base.itemsize for step in steps], writeable=True
    )
    numbers = [number(item) for item in data]
    if kind == "int64" and not all(type(item) is int for item in numbers):
        raise FormError("an array of int64 has whole numbers only")
    values[...] = np.array(numbers, dtype=kind).reshape(shape)
    return values
