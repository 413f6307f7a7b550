"""Reading of targets in a script: places, joint angles, pitch and roll, branches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from katana450.extensions.general_arms.branch_words import BRANCH_NAMES
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step_target import Angles, StepTarget
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch

ROOMIEST = "roomiest"
"""The word for the pitch that keeps the joints farthest from their limits along an arc."""

LEAST_JOINTS, MAX_JOINTS = 3, 32
"""Numbers of joints of an arm."""


def place(value: YamlValue, setting: ScriptContext) -> StepTarget:
    """Read the name of a pose, {joints: [...]}, or {x, y, z, pitch, roll, yaw, branch}.

    Raises ScriptError.
    """
    if value.kind == "text":
        if value.held not in setting.poses:
            known = ", ".join(setting.poses) or "none"
            raise value.wrong(f"There is no pose {value}. Under `poses:` are: {known}.")
        return setting.poses[str(value.held)]
    fields = Fields(value, "a place")
    if fields.has("joints"):
        found = fields.take("joints", joints, None)
        fields.done()
        return StepTarget(joints=found)
    position = np.array([fields.need(name, read.millimetres(), 0.0) for name in read.XYZ])
    at = StepTarget(None, position, angles(fields), branch(fields), setting.in_base)
    fields.done()
    return at


def point(value: YamlValue, setting: ScriptContext) -> FloatArray:
    """Read a point (3,) [m]: {x, y, z}, [x, y, z], or the name of a pose that has one.

    Raises ScriptError.
    """
    if value.kind != "text":
        found: FloatArray = read.vector(read.millimetres())(value)
        return found
    return _position(place(value, setting), value)


def _position(pose: StepTarget, value: YamlValue) -> FloatArray:
    if pose.position is None:
        raise value.wrong(
            f"The pose {value} is given by joint angles, so it is no point. Use it in `move`, or "
            "give it by x, y and z."
        )
    return pose.position


def pose(value: YamlValue, setting: ScriptContext) -> StepTarget:
    """Read a point as ``point`` does; a named pose also gives its orientation.

    Raises ScriptError.
    """
    if value.kind != "text":
        return StepTarget(None, point(value, setting), in_base=setting.in_base)
    named = place(value, setting)
    _position(named, value)
    return named


def joints(value: YamlValue) -> FloatArray:
    """Read the angles (n,) of all joints in degrees; returns [rad]. Raises ScriptError."""
    return np.array(read.angles(-720.0, 720.0, LEAST_JOINTS, MAX_JOINTS)(value))


def pitch(value: YamlValue) -> float | str | None:
    """Read a pitch: an angle [rad], ROOMIEST, or None for ``keep``. Raises ScriptError."""
    if value.number is not None:
        return read.angle(-360.0, 360.0)(value)
    named = read.choice("keep", ROOMIEST)(value)
    return None if named == "keep" else named


def angles(fields: Fields) -> Angles:
    """Read pitch, roll and yaw [rad]; None where they are absent."""
    each: Callable[[YamlValue], float | None] = read.angle(-360.0, 360.0)
    return Angles(*(fields.take(name, each, None) for name in Angles._fields))


def branch(fields: Fields) -> AnyBranch | None:
    """Read a branch; None if it is absent."""
    return fields.take("branch", read.choice(*BRANCH_NAMES), None)
