"""Reading of the fields of a YAML mapping by name and type; unknown fields are refused."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from katana450.errors import InputError
from katana450.extensions.programs.expression import (
    ANGLE,
    FORCE,
    LENGTH,
    PLAIN,
    TIME,
    with_article,
)
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue
from katana450.maths.geometry.arrays import FloatArray, frozen

T = TypeVar("T")
D = TypeVar("D")

MAX_COORDINATE = 2000.0
"""[mm] Maximum magnitude of a coordinate."""

MAX_ANGLE = 3600.0
"""[deg] Maximum magnitude of an angle."""

XYZ = ("x", "y", "z")

KINDS = {
    "mm": (LENGTH,),
    "deg": (ANGLE,),
    "s": (TIME,),
    "N": (FORCE,),
    "deg or mm": (ANGLE, LENGTH),
}
"""The kinds of quantities that can be given where a number in a unit is expected."""


class Fields:
    """The fields of one mapping. Problems are collected, so that all are reported at once."""

    def __init__(self, value: YamlValue, what: str) -> None:
        """Take a mapping. ``what`` names it in messages, as in "a circle". Raises ScriptError."""
        self.value = value
        self.what = what
        self.problems: list[Problem] = []
        self._known: list[str] = []
        self._held: dict[str, YamlValue] = {}
        if value.kind != "mapping":
            raise value.wrong(
                f"{what.capitalize()} must be a mapping of names to values, not {value}."
            )
        for name, held in value.fields:
            if not isinstance(name.held, str):
                self.problems += name.wrong(f"A name must be a text, not {name}.").problems
            elif name.held in self._held:
                problem = f"{name.held!r} is given twice in {what}."
                self.problems += name.wrong(problem).problems
            else:
                self._held[name.held] = held
        self._names = {str(name.held): name for name, _ in value.fields}

    def has(self, name: str) -> bool:
        """Return whether the field is given."""
        self._known.append(name)
        return name in self._held

    def take(self, name: str, read: Callable[[YamlValue], T], default: D) -> T | D:
        """Return the field as ``read`` converts it, or ``default`` if it is absent or wrong."""
        self._known.append(name)
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
        """Return a required field as ``read`` converts it; ``instead`` if it is absent or wrong."""
        if name not in self._held:
            problem = f"{self.what.capitalize()} needs {name!r}."
            self.problems += self.value.wrong(problem).problems
        return self.take(name, read, instead)

    def done(self) -> None:
        """Refuse unknown fields, together with all other problems. Raises ScriptError."""
        for name in self._held:
            if name not in self._known:
                problem = f"{self.what.capitalize()} has no {name!r}{or_known(name, self._known)}"
                self.problems += self._names[name].wrong(problem).problems
        if self.problems:
            raise ScriptError(tuple(self.problems))


def or_known(name: str, known: Sequence[str]) -> str:
    """Return the end of a message on an unknown ``name``: the nearest known name, or all names."""
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; it may have {', '.join(known)}." if known else "; it has no fields."


def number(low: float, high: float, unit: str = "") -> Callable[[YamlValue], float]:
    """Return a reader of a finite number from ``low`` to ``high``."""
    of = f" {unit}" if unit else ""

    def read(value: YamlValue) -> float:
        found = value.number if value.kind in ("whole", "number") else _plain(value)
        if found is None or not math.isfinite(found):
            why = f": {value.why}." if value.why else "."
            raise value.wrong(f"Expected a number from {low:g} to {high:g}{of}, not {value}{why}")
        if value.unit != PLAIN and value.unit not in KINDS.get(unit, ()):
            wanted = f"a number in {unit}" if unit else "a number without a unit"
            raise value.wrong(f"Expected {wanted}, not {with_article(value.unit)}: {value}.")
        if not low <= found <= high:
            raise value.wrong(f"{found:g} is not between {low:g} and {high:g}{of}.")
        return found

    return read


def whole(low: int, high: int) -> Callable[[YamlValue], int]:
    """Return a reader of a whole number from ``low`` to ``high``."""

    def read(value: YamlValue) -> int:
        found = number(low, high)(value)
        if found != int(found):
            raise value.wrong(f"Expected a whole number from {low} to {high}, not {value}.")
        return int(found)

    return read


def text(value: YamlValue) -> str:
    """Read a text that is not blank; a number is not a text. Raises ScriptError."""
    if value.kind != "text" or not isinstance(value.held, str) or not value.held.strip():
        raise value.wrong(f"Expected a text, not {value}.")
    return value.held


def choice(*names: str) -> Callable[[YamlValue], str]:
    """Return a reader of one of ``names``."""

    def read(value: YamlValue) -> str:
        if value.held not in names:
            raise value.wrong(f"Expected one of {', '.join(names)}, not {value}.")
        return str(value.held)

    return read


def degrees(low: float = -MAX_ANGLE, high: float = MAX_ANGLE) -> Callable[[YamlValue], float]:
    """Return a reader of an angle in degrees, as programs write it; it returns [rad]."""
    read = number(low, high, "deg")
    return lambda value: math.radians(read(value))


def angle(low: float = -MAX_ANGLE, high: float = MAX_ANGLE) -> Callable[[YamlValue], float]:
    """Return a reader of an angle as people write it; see ``angles``."""
    read = angles(low, high, 1, 1)
    return lambda value: read(replace(value, kind="list", held=(value,)))[0]


def angles(low: float, high: float, fewest: int, most: int) -> Callable[[YamlValue], list[float]]:
    """Return a reader of a list of angles in degrees, which refuses those that look like radians.

    It returns [rad].
    """
    read = listed(number(low, high, "deg"), fewest, most)

    def all_of(value: YamlValue) -> list[float]:
        found = read(value)
        plain = all(item.unit == PLAIN for item in value.items)
        if plain and max(map(abs, found)) < 2.0 * math.pi + 0.01:
            for item, angle in zip(value.items, found, strict=True):
                if _is_fraction_of_pi(item, abs(angle)):
                    text = str(item.held)
                    text = f"({text}) * 1" if _decimals(text) is None else text
                    raise item.wrong(
                        f"{item.held} looks like radians, and angles are in degrees. Give its "
                        f"unit: `{text} rad`, or `{text} deg` if that is meant."
                    )
        return [math.radians(angle) for angle in found]

    return all_of


def _is_fraction_of_pi(value: YamlValue, angle: float) -> bool:
    """Return whether ``angle`` > 0 is a multiple of pi / 12 to all digits that ``value`` has."""
    digits = _decimals(str(value.held))
    digits = 9 if digits is None else digits
    steps = round(angle * 12.0 / math.pi)
    # Two decimals are enough only for quarters of a turn.
    exact = digits >= 3 or (digits == 2 and steps % 6 == 0)
    return exact and steps > 0 and abs(steps * math.pi / 12.0 - angle) <= 0.51 * 10.0**-digits


def _decimals(text: str) -> int | None:
    """Return the number of decimal places of a number; None for an expression."""
    whole, _, decimals = text.lstrip("+-").partition(".")
    return len(decimals) if (whole + decimals).isdigit() else None


def millimetres(
    low: float = -MAX_COORDINATE, high: float = MAX_COORDINATE
) -> Callable[[YamlValue], float]:
    """Return a reader of a length in mm; it returns [m]."""
    read = number(low, high, "mm")
    return lambda value: 1e-3 * read(value)


def listed(
    read: Callable[[YamlValue], T], low: int, high: int
) -> Callable[[YamlValue], tuple[T, ...]]:
    """Return a reader of a list of ``low`` to ``high`` values, each of which ``read`` converts."""

    def all_of(value: YamlValue) -> tuple[T, ...]:
        if value.kind != "list":
            raise value.wrong(f"Expected a list, not {value}.")
        if not low <= len(value.items) <= high:
            many = f"{low}" if low == high else f"{low} to {high}"
            raise value.wrong(f"Expected a list of {many} values, not of {len(value.items)}.")
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
    """Return a reader of {x, y, z} or [x, y, z] as (3,). ``partly``: absent components are 0."""

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
    """Read a unit vector (3,); x, -x, y, -y, z or -z stand for the axes. Raises ScriptError."""
    if isinstance(value.held, str):
        sign, name = (-1.0, value.held[1:]) if value.held[:1] == "-" else (1.0, value.held)
        if name not in XYZ:
            raise value.wrong(f"Expected x, y, z, -x, -y, -z or three numbers, not {value}.")
        return frozen(sign * np.eye(3)[XYZ.index(name)])
    found: FloatArray = vector(number(-MAX_COORDINATE, MAX_COORDINATE), partly=True)(value)
    length = math.hypot(*found)
    if length < 1e-9:
        raise value.wrong("A direction must not be zero.")
    return frozen(found / length)


def _plain(value: YamlValue) -> float | None:
    """Return a number that YAML takes for a text, such as 1e-3; None for any other text."""
    return value.number if value.kind == "text" else None
