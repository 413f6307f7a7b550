"""The support of an object: the table, or another object that it stands on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.arm.control.pouring import BASIN, CUP
from katana450.arm.control.things import Environment, Form, Mount, Thing
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import Table

GAP = 1e-3
"""[m] An object that hangs no higher than this over a surface stands on it."""

UPRIGHT = 0.999
"""Cosine of the tilt up to which the top of an object is level enough to carry another."""


def is_loose(thing: Thing) -> bool:
    """Whether ``thing`` needs something to stand on: the cup, the basin, and what can be held.

    Anything else is a part of the work cell and may hang in the air.
    """
    return not thing.carried and (thing.can_be_held or thing.name in (CUP, BASIN))


def check_carried(table: Table | None, things: Sequence[Thing], thing: Thing) -> None:
    """Raise InputError, with the position and the table's extent, if nothing carries ``thing``.

    An object is carried where its middle is over the table or over an upright object, and its
    lowest point is on that. table: None where there is none to judge by.
    """
    if table is None or thing.carried:
        return
    (x, y), lowest = thing.T_shape[:2, 3], _lowest(thing)
    tops = [each.T[2, 3] + each.height for each in things if _is_over(thing, each)]
    if table.x[0] <= x <= table.x[1] and table.y[0] <= y <= table.y[1]:
        tops.append(0.0)
    if any(lowest - top <= GAP for top in tops):
        return
    at = f"{thing.name} would be in the air at x {1e3 * x:.1f}, y {1e3 * y:.1f}"
    if tops:
        gap = f"{1e3 * (lowest - max(tops)):.1f} mm"
        raise InputError(f"{at} mm, {gap} above what is below it: put it {gap} lower.")
    (left, right), (front, back) = 1e3 * np.array(table.x), 1e3 * np.array(table.y)
    raise InputError(
        f"{at} mm: nothing carries it there. The table reaches from x {left:.0f} to {right:.0f} "
        f"and from y {front:.0f} to {back:.0f} mm in the base frame; choose a place on it."
    )


def check_mounted(
    surroundings: Environment, things: Sequence[Thing], thing: Thing, to: Mount, x: FloatArray
) -> None:
    """Raise InputError if ``thing``, taken off the hand, would be left where nothing carries it.

    x: (k,) joints and finger joint [rad].
    """
    left = surroundings.mounted(thing, to, x)
    if to is Mount.TABLE or is_loose(left):
        check_carried(surroundings.table, things, left)


def _lowest(thing: Thing) -> float:
    """Height [m] of the lowest point in the base frame; of a tilted mesh, of the box round it."""
    T, down = thing.T_shape, abs(thing.T[2, :3])
    match thing.form:
        case Form.SPHERE:
            reach = thing.extent[0]
        case Form.CYLINDER:
            radius, height = thing.extent
            reach = radius * float(np.hypot(down[0], down[1])) + 0.5 * height * down[2]
        case _:
            reach = 0.5 * float(down @ thing.extent)
    return float(T[2, 3] - reach)


def _is_over(thing: Thing, other: Thing) -> bool:
    """Whether the middle of ``thing`` is over the level top of ``other``."""
    if other.name == thing.name or other.carried or other.form is Form.SPHERE:
        return False
    if other.T[2, 2] < UPRIGHT:
        return False
    x, y, _ = se3.inverse(other.T)[:3] @ np.append(thing.T_shape[:3, 3], 1.0)
    if other.form is Form.CYLINDER:
        return bool(np.hypot(x, y) <= other.extent[0])
    return bool(abs(x) <= 0.5 * other.extent[0] and abs(y) <= 0.5 * other.extent[1])
