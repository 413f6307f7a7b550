"""The support of an object: the table, or another object that it stands on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.pouring import BASIN, is_vessel
from katana450.arm.control.state.scene_objects import Attachment, SceneObject, Shape
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import TableTop

SUPPORT_GAP = 1e-3
"""[m] Height over a surface up to which an object counts as standing on it."""

MIN_UPRIGHT = 0.999
"""Cosine of the tilt up to which the top of an object is level enough to carry another."""


def is_loose(scene_object: SceneObject) -> bool:
    """Return whether ``scene_object`` needs a support: vessels, the basin, and holdable objects.

    All other objects are parts of the work cell and may hang in the air.
    """
    return not scene_object.carried and (
        scene_object.can_be_held or is_vessel(scene_object) or scene_object.name == BASIN
    )


def check_carried(
    table: TableTop | None,
    objects: Sequence[SceneObject],
    scene_object: SceneObject,
    *,
    may_fall: bool = False,
) -> None:
    """Raise InputError, with the position and the table's extent, if an object has no support.

    An object is carried if its middle is over the table or over an upright object, and its
    lowest point is on that, or, if it ``may_fall``, above that.

    table: None if the support is not checked.
    """
    if table is None or scene_object.carried:
        return
    (x, y), lowest = scene_object.T_collision_shape[:2, 3], _lowest(scene_object)
    tops = [other.T[2, 3] + other.height for other in objects if is_over(scene_object, other)]
    if table.x[0] <= x <= table.x[1] and table.y[0] <= y <= table.y[1]:
        tops.append(0.0)
    if any(may_fall or lowest - top <= SUPPORT_GAP for top in tops):
        return
    refusal = f"{scene_object.name} would be in the air at x {1e3 * x:.1f}, y {1e3 * y:.1f}"
    if tops:
        gap = f"{1e3 * (lowest - max(tops)):.1f} mm"
        raise InputError(f"{refusal} mm, {gap} above its support: put it {gap} lower.")
    (left, right), (front, back) = 1e3 * np.array(table.x), 1e3 * np.array(table.y)
    raise InputError(
        f"{refusal} mm: nothing carries it there. The table reaches from x {left:.0f} to "
        f"{right:.0f} and from y {front:.0f} to {back:.0f} mm in the base frame; choose a place "
        "on it."
    )


def surface_below(objects: Sequence[SceneObject], scene_object: SceneObject) -> float:
    """Return the height [m] of the highest level surface below the middle of an object.

    The object is where it would be released; the table is at 0.
    """
    lowest = _lowest(scene_object) + SUPPORT_GAP
    tops = [other.T[2, 3] + other.height for other in objects if is_over(scene_object, other)]
    return max((float(top) for top in tops if top <= lowest), default=0.0)


def check_mounted(
    environment: Environment,
    objects: Sequence[SceneObject],
    scene_object: SceneObject,
    to: Attachment,
    x: FloatArray,
) -> None:
    """Raise InputError if nothing would be below ``scene_object``, taken off the hand.

    x: (k,) joints and finger joint [rad].
    """
    left = environment.mounted(scene_object, to, x)
    if to is Attachment.TABLE or is_loose(left):
        check_carried(environment.table, objects, left, may_fall=True)


def _lowest(scene_object: SceneObject) -> float:
    """Return the height [m] of the lowest point in the base frame; for a mesh, of its box."""
    T, down = scene_object.T_collision_shape, abs(scene_object.T[2, :3])
    match scene_object.shape:
        case Shape.SPHERE:
            reach = scene_object.extent[0]
        case Shape.CYLINDER | Shape.VESSEL:
            radius, height = scene_object.extent
            reach = radius * float(np.hypot(down[0], down[1])) + 0.5 * height * down[2]
        case _:
            reach = 0.5 * float(down @ scene_object.extent)
    return float(T[2, 3] - reach)


def is_over(scene_object: SceneObject, other: SceneObject) -> bool:
    """Return whether the middle of ``scene_object`` is over the level top of ``other``."""
    if other.name == scene_object.name or other.carried or other.is_zone:
        return False
    if other.shape is Shape.SPHERE:
        return False
    if other.T[2, 2] < MIN_UPRIGHT:
        return False
    x, y, _ = se3.inverse(other.T)[:3] @ np.append(scene_object.T_collision_shape[:3, 3], 1.0)
    if other.shape.is_round:
        return bool(np.hypot(x, y) <= other.extent[0])
    return bool(abs(x) <= 0.5 * other.extent[0] and abs(y) <= 0.5 * other.extent[1])
