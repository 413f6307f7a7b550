"""Reading a value's fields: each asked for by name and kind, everything left over refused."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from katana450.errors import InputError
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue
from katana450.maths.geometry.arrays import FloatArray, frozen

T = TypeVar("T")
D = TypeVar("D")

MAX_COORDINATE = 2000.0
"""[mm] No coordinate is larger."""

MAX_ANGLE = 3600.0
"""[deg] Nor angle."""

XYZ = ("x", "y", "z")


class Fields:
    """The fields of one value. What is wrong is gathered, so that all of it is told at once."""

    def __init__(self, value: YamlValue, what: str) -> None:
        """``what``: how a person calls it, as in "a circle"."""
        self.value = value
        self.what = what
        self.problems: list[Problem] = []
        self._asked: list[str] = []
        self._held: dict[str, YamlValue] = {}
        if value.kind != "mapping":
            raise value.wrong(f"{what.capitalize()} is names with values, not {value}.")
        for name, held in value.fields:
            if not isinstance(name.held, str):
                self.problems += name.wrong(f"A name is a text, not {name}.").problems
            elif name.held in self._held:
                said = f"{name.held!r} is given twice in {what}."
                self.problems += name.wrong(said).problems
            else:
                self._held[name.held] = held
        self._names = {str(name.held): name for name, _ in value.fields}

    def has(self, name: str) -> bool:
        """Whether it is given."""
        self._asked.append(name)
        return name in self._held

    def take(self, name: str, read: Callable[[YamlValue], T], default: D) -> T | D:
        """What ``read`` makes of the field, or the default where it is not given."""
        self._asked.append(name)
        if name not in self._held:
            return default
        try:
            return read(self._held[name])
        except ScriptError as error:
            self.problems += error.problems
        except InputError as error:
            self.problems += self._held[name].wrong(str(error)).problems
        return default

    def need(self, name: str, read: Callable[[YamlValue], T], instead: D) -> T | D:
        """The same of one that has to be there; ``instead`` goes on where it is not."""
        if name not in self._held:
            said = f"{self.what.capitalize()} needs {name!r}."
            self.problems += self.value.wrong(said).problems
        return self.take(name, read, instead)

    def done(self) -> None:
        """Refuse what nobody asked for, with all else that is wrong. Raises ScriptError."""
        for name in self._held:
            if name not in self._asked:
                said = f"{self.what.capitalize()} has no {name!r}{or_known(name, self._asked)}"
                self.problems += self._names[name].wrong(said).problems
        if self.problems:
            raise ScriptError(tuple(self.problems))


def or_known(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; it may have {', '.join(known)}." if known else "; it has nothing."


def number(low: float, high: float, unit: str = "") -> Callable[[YamlValue], float]:
    """Reads a finite number from ``low`` to ``high``."""
    of = f" {unit}" if unit else ""

    def read(value: YamlValue) -> float:
        found = value.number if value.kind in ("whole", "number") else _plain(value)
        if found is None or not math.isfinite(found):
            raise value.wrong(f"A number from {low:g} to {high:g}{of} goes here, not {value}.")
        if not low <= found <= high:
            raise value.wrong(f"{found:g} is not between {low:g} and {high:g}{of}.")
        return found

    return read


def whole(low: int, high: int) -> Callable[[YamlValue], int]:
    """Reads a whole number from ``low`` to ``high``."""

    def read(value: YamlValue) -> int:
        found = number(low, high)(value)
        if found != int(found):
            raise value.wrong(f"A whole number from {low} to {high} goes here, not {value}.")
        return int(found)

    return read


def text(value: YamlValue) -> str:
    """A text; a number is none."""
    if value.kind != "text" or not isinstance(value.held, str) or not value.held.strip():
        raise value.wrong(f"A text goes here, not {value}.")
    return value.held


def choice(*names: str) -> Callable[[YamlValue], str]:
    """Reads one of ``names``."""

    def read(value: YamlValue) -> str:
        if value.held not in names:
            raise value.wrong(f"One of {', '.join(names)} goes here, not {value}.")
        return str(value.held)

    return read


def degrees(low: float = -MAX_ANGLE, high: float = MAX_ANGLE) -> Callable[[YamlValue], float]:
    """Reads an angle that is given in degrees, as [rad]."""
    read = number(low, high, "deg")
    return lambda value: math.radians(read(value))


def millimetres(
    low: float = -MAX_COORDINATE, high: float = MAX_COORDINATE
) -> Callable[[YamlValue], float]:
    """Reads a length that is given in mm, as [m]."""
    read = number(low, high, "mm")
    return lambda value: 1e-3 * read(value)


def listed(
    read: Callable[[YamlValue], T], low: int, high: int
) -> Callable[[YamlValue], tuple[T, ...]]:
    """Reads a list of ``low`` to ``high`` such values."""

    def all_of(value: YamlValue) -> tuple[T, ...]:
        if value.kind != "list":
            raise value.wrong(f"A list goes here, not {value}.")
        if not low <= len(value.items) <= high:
            many = f"{low}" if low == high else f"{low} to {high}"
            raise value.wrong(f"A list of {many} goes here, not of {len(value.items)}.")
        found: list[T] = []
        problems: list[Problem] = []
        for item in value.items:
            try:
                found.append(read(item))
            except ScriptError as error:
                problems += error.problems
        if problems:
            raise ScriptError(tuple(problems))
        return tuple(found)

    return all_of


def vector(
    each: Callable[[YamlValue], float], *, partly: bool = False
) -> Callable[[YamlValue], Any]:
    """Reads {x, y, z} or [x, y, z]; (3,). ``partly``: what is not named is 0."""

    def read(value: YamlValue) -> FloatArray:
        if value.kind == "list":
            return frozen(listed(each, 3, 3)(value))
        fields = Fields(value, "a vector")
        take = fields.take if partly else fields.need
        found = [take(name, each, 0.0) for name in XYZ]
        fields.done()
        return frozen(found)

    return read


def direction(value: YamlValue) -> FloatArray:
    """A unit vector (3,); x, y or z alone is that axis, with a sign where it points back."""
    if isinstance(value.held, str):
        sign, name = (-1.0, value.held[1:]) if value.held[:1] == "-" else (1.0, value.held)
        if name not in XYZ:
            raise value.wrong(f"A direction is x, y, z, -x, -y, -z or three numbers, not {value}.")
        return frozen(sign * np.eye(3)[XYZ.index(name)])
    found: FloatArray = vector(number(-MAX_COORDINATE, MAX_COORDINATE), partly=True)(value)
    length = math.hypot(*found)
    if length < 1e-9:
        raise value.wrong("A direction is not zero.")
    return frozen(found / length)


def _plain(value: YamlValue) -> float | None:
    """Of what YAML takes for a text though people write it for a number, as 1e-3."""
    return value.number if value.kind == "text" else None
