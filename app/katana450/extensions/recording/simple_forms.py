"""Forms of numbers, texts, members of enumerations and arrays, exact to the bit.

JSON has no infinity and no NaN, so these are texts. A finite number is written with as many digits
as it needs to be read back exactly.
"""

from __future__ import annotations

import math
import struct
from enum import Enum
from typing import Any, Protocol

import numpy as np

from katana450.extensions.recording.form_error import FormError, shown

MAX_ITEMS = 1_000_000
"""Maximum number of items of an array or a tuple."""

MAX_INT = 2**63 - 1
"""Largest whole number: JSON readers of other languages take no larger ones exactly either."""

QUIET_NAN = struct.pack(">d", math.nan)
NOT_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


class Coder(Protocol):
    """Makes forms of the values of one type, and the values of forms.

    Attributes:
        python: types of the values.
        json: types of the forms.
    """

    python: tuple[type, ...]
    json: tuple[type, ...]

    def encode(self, value: Any) -> Any:
        """Return the form of ``value``. Raises FormError."""
        ...

    def decode(self, form: Any) -> Any:
        """Return the value of ``form``. Raises FormError."""
        ...


def _not_finite(value: float) -> str:
    """Return the text of an infinity or a NaN, with the bits of an unusual NaN."""
    if math.isinf(value):
        return "inf" if value > 0.0 else "-inf"
    bits = struct.pack(">d", value)
    return "nan" if bits == QUIET_NAN else f"nan:{bits.hex()}"


def _float_of(text: str) -> float:
    if text in NOT_FINITE:
        return NOT_FINITE[text]
    kind, _, digits = text.partition(":")
    try:
        bits = bytes.fromhex(digits)
    except ValueError:
        bits = b""
    if kind == "nan" and len(bits) == 8 and math.isnan(value := struct.unpack(">d", bits)[0]):
        return float(value)
    raise FormError(f"{shown(text)} is not a number")


def number_form(value: Any) -> float | int | str:
    """Return the form of a number. Raises FormError for types that JSON cannot give back."""
    if isinstance(value, float):
        value = float(value)
        return value if math.isfinite(value) else _not_finite(value)
    if isinstance(value, bool):
        return value
    if isinstance(value, int | np.integer) and abs(int(value)) <= MAX_INT:
        return int(value)
    raise FormError(f"{shown(value)} is not a number of 64 bits")


def number(form: Any) -> float | int:
    """Return the number of ``form``. Raises FormError."""
    if isinstance(form, float | int):
        if isinstance(form, int) and abs(form) > MAX_INT:
            raise FormError(f"{shown(form)} is not a number of 64 bits")
        return form
    if isinstance(form, str):
        return _float_of(form)
    raise FormError(f"{shown(form)} is not a number")


class FloatCoder:
    """Coder of a field that holds a float; a whole number in it stays one."""

    python: tuple[type, ...] = (float, int, bool, np.float64, np.int64)
    json: tuple[type, ...] = (float, int, bool, str)
    encode = staticmethod(number_form)
    decode = staticmethod(number)


class IntCoder:
    """Coder of a field that holds a whole number."""

    python: tuple[type, ...] = (int, np.int64)
    json: tuple[type, ...] = (int,)

    def encode(self, value: Any) -> Any:
        """Return the form of ``value``."""
        form = number_form(value)
        if type(form) is not int:
            raise FormError(f"{shown(value)} is not a whole number")
        return form

    def decode(self, form: Any) -> Any:
        """Return the value of ``form``."""
        if type(form) is not int or abs(form) > MAX_INT:
            raise FormError(f"{shown(form)} is not a whole number")
        return form


class PlainCoder:
    """Coder of a text or a truth value, which is its own form."""

    def __init__(self, kind: type, allowed: tuple[Any, ...] = ()) -> None:
        """Code values of ``kind``, only those in ``allowed`` if there are any."""
        self.python: tuple[type, ...] = (kind,)
        self.json: tuple[type, ...] = (kind,)
        self._kind, self._allowed = kind, allowed

    def encode(self, value: Any) -> Any:
        """Return ``value`` itself."""
        if isinstance(value, str):
            try:
                value.encode()
            except UnicodeEncodeError as error:
                raise FormError(f"it is not Unicode: {error}") from None
        return self.decode(value)

    def decode(self, form: Any) -> Any:
        """Return ``form`` itself."""
        if type(form) is not self._kind:
            raise FormError(f"{shown(form)} is not of the type {self._kind.__name__}")
        if self._allowed and form not in self._allowed:
            raise FormError(f"{shown(form)} is not one of {', '.join(map(repr, self._allowed))}")
        return form


class BytesCoder:
    """Coder of bytes as hexadecimal digits."""

    python: tuple[type, ...] = (bytes,)
    json: tuple[type, ...] = (str,)

    def encode(self, value: Any) -> Any:
        """Return the digits of ``value``."""
        return bytes(value).hex()

    def decode(self, form: Any) -> Any:
        """Return the bytes of the digits ``form``."""
        try:
            return bytes.fromhex(form)
        except (TypeError, ValueError):
            raise FormError(f"{shown(form)} is not a row of hexadecimal digits") from None


class EnumCoder:
    """Coder of the members of an enumeration by their names."""

    json: tuple[type, ...] = (str,)

    def __init__(self, kind: type[Enum]) -> None:
        """Code the members of ``kind``."""
        self.python: tuple[type, ...] = (kind,)
        self._kind = kind
        self._members = dict(kind.__members__)

    def encode(self, value: Any) -> Any:
        """Return the name of ``value``."""
        if not isinstance(value, self._kind):
            raise FormError(f"{shown(value)} is not a {self._kind.__name__}")
        return value.name

    def decode(self, form: Any) -> Any:
        """Return the member with the name ``form``."""
        member = self._members.get(form) if isinstance(form, str) else None
        if member is None:
            raise FormError(f"{shown(form)} is not one of {', '.join(self._members)}")
        return member


class ArrayCoder:
    """Coder of arrays: rows of numbers, or an object if the rows alone do not tell all.

    The object has the shape, the type and the steps of the memory, because sums of products
    can be rounded otherwise for another order of the same numbers in memory.
    """

    python: tuple[type, ...] = (np.ndarray,)
    json: tuple[type, ...] = (list, dict)

    def encode(self, value: Any) -> Any:
        """Return the form of an array."""
        if not isinstance(value, np.ndarray):
            raise FormError(f"{shown(value)} is not an array")
        if value.dtype == np.float64 and value.flags.c_contiguous and value.size and value.ndim:
            rows = value.tolist()
            return rows if np.isfinite(value).all() else _mapped(rows)
        if value.dtype not in (np.float64, np.int64):
            raise FormError(f"an array of {value.dtype} has no form")
        steps = tuple(step // value.itemsize for step in value.strides)
        if min(steps, default=0) < 0:
            raise FormError("an array that runs backwards in memory has no form")
        return {
            "shape": list(value.shape),
            "type": value.dtype.name,
            "steps": list(steps),
            "data": [number_form(each) for each in value.ravel(order="C").tolist()],
        }

    def decode(self, form: Any) -> Any:
        """Return the array of ``form``, read-only."""
        array = _of_rows(form) if isinstance(form, list) else _of_object(form)
        array.setflags(write=False)
        return array


def _mapped(rows: Any) -> Any:
    return [_mapped(row) for row in rows] if isinstance(rows, list) else number_form(rows)


def _of_rows(form: list[Any]) -> np.ndarray[Any, Any]:
    shape: list[int] = []
    row: Any = form
    while isinstance(row, list):
        shape.append(len(row))
        row = row[0] if row else None
    count = math.prod(shape)
    if not 0 < count <= MAX_ITEMS:
        raise FormError(f"an array of the shape {shown(tuple(shape))} is empty or too large")
    flat = form
    for length in shape[1:]:
        if not all(isinstance(each, list) and len(each) == length for each in flat):
            raise FormError("the rows of an array have different lengths")
        flat = [item for each in flat for item in each]
    numbers = [float(number(each)) for each in flat]
    return np.array(numbers, dtype=np.float64).reshape(shape)


def _of_object(form: Any) -> np.ndarray[Any, Any]:
    if not isinstance(form, dict) or set(form) != {"shape", "type", "steps", "data"}:
        raise FormError(f"{shown(form)} is not an array")
    shape, steps, data, kind = form["shape"], form["steps"], form["data"], form["type"]
    for each in (shape, steps):
        if not isinstance(each, list) or not all(type(n) is int and n >= 0 for n in each):
            raise FormError("shape and steps of an array are whole numbers from 0")
    if kind not in ("float64", "int64") or len(shape) != len(steps) or not isinstance(data, list):
        raise FormError(f"{shown(form)} is not an array")
    count = math.prod(shape)
    room = 1 + sum((n - 1) * step for n, step in zip(shape, steps, strict=True) if n)
    if len(shape) > 8 or count != len(data) or max(count, room) > MAX_ITEMS:
        raise FormError(f"an array of the shape {shown(shape)} does not have {len(data)} items")
    base = np.zeros(room, dtype=kind)
    array = np.lib.stride_tricks.as_strided(
        base, shape, [step * base.itemsize for step in steps], writeable=True
    )
    numbers = [number(each) for each in data]
    if kind == "int64" and not all(type(each) is int for each in numbers):
        raise FormError("an array of int64 has whole numbers only")
    array[...] = np.array(numbers, dtype=kind).reshape(shape)
    return array
