"""Values of a script that is written in Python, as YAML writes them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray

Number = float | str
"""A number in the unit of its place (mm, deg, s, ml), or a text with a unit, such as "4 cm"."""

Point = Sequence[Number] | FloatArray | Mapping[str, Number] | str
"""A point: three numbers, {x, y, z}, or the name of a pose."""

Place = Mapping[str, Any] | str
"""A place: the name of a pose, {"joints": [...]}, or {x, y, z, pitch, roll, yaw, branch}."""


def given(**values: Any) -> dict[str, Any]:
    """Return the values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def object_value(name: str, **how: Any) -> str | dict[str, Any]:
    """Return the object ``name``, with those values of ``how`` that are not None."""
    more = given(**how)
    return {"object": name, **more} if more else name


def place_value(
    at: Point | None,
    joints: Sequence[Number] | None,
    pitch: Number | None,
    roll: Number | None,
    branch: str | None,
    yaw: Number | None = None,
) -> dict[str, Any]:
    """Return a place as a mapping. Raises InputError for a point that is none."""
    angles = given(pitch=pitch, roll=roll, yaw=yaw, branch=branch)
    if joints is not None:
        return {"joints": plain(list(joints)), **angles}
    point = plain(at)
    if isinstance(point, list) and len(point) == 3:
        point = dict(zip("xyz", point, strict=True))
    if not isinstance(point, dict):
        raise InputError(f"A place needs three numbers x, y and z, not {at!r}.")
    return {**point, **angles}


def plain(value: Any) -> Any:
    """Return ``value`` as YAML writes it; numbers of numpy become those of Python."""
    match value:
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case Mapping():
            return {str(name): plain(each) for name, each in value.items()}
        case list() | tuple():
            return [plain(each) for each in value]
        case float() if not math.isfinite(value):
            raise InputError(f"A number of a script must be finite, not {value}.")
    return value
