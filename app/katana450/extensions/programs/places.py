"""Reading where the arm is to be: places, joint angles, pitch and roll, branches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from katana450.extensions.programs import fields as read
from katana450.extensions.programs.bench import Place
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch

ROOMIEST = "roomiest"
"""The pitch that leaves the joints the most room along an arc."""


def place(value: Value, setting: Setting) -> Place:
    """The name of a pose, {joints: [...]}, or {x, y, z, pitch, roll, branch}."""
    if value.kind == "text":
        if value.held not in setting.poses:
            known = ", ".join(setting.poses) or "none; give it under `poses:`"
            raise value.wrong(f"There is no pose {value}; there are {known}.")
        return setting.poses[str(value.held)]
    fields = Fields(value, "a place")
    if fields.has("joints"):
        found = fields.take("joints", joints, None)
        fields.done()
        return Place(joints=found)
    position = np.array([fields.need(name, read.millimetres(), 0.0) for name in read.XYZ])
    at = Place(None, position, *angles(fields), branch(fields), setting.in_base)
    fields.done()
    return at


def joints(value: Value) -> FloatArray:
    """Five angles (5,) [rad]."""
    return np.array(read.listed(read.degrees(-720.0, 720.0), 5, 5)(value))


def pitch(value: Value) -> float | str | None:
    """[rad], ROOMIEST, or None to keep it."""
    if value.number is not None:
        return read.degrees(-360.0, 360.0)(value)
    named = read.choice("keep", ROOMIEST)(value)
    return None if named == "keep" else named


def angles(fields: Fields) -> tuple[float | None, float | None]:
    """Pitch and roll [rad], None where they are not given."""
    each: Callable[[Value], float | None] = read.degrees(-360.0, 360.0)
    return fields.take("pitch", each, None), fields.take("roll", each, None)


def branch(fields: Fields) -> Branch | None:
    """None where it is not given."""
    names = [str(each) for each in BRANCHES]
    named = fields.take("branch", read.choice(*names), "")
    return Branch.parse(named) if named else None
