"""Kinds of targets in a script: places, points and the pitch along a curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from katana450.extensions.programs.language.declaration import Declared, Fields, Kind
from katana450.extensions.programs.language.kinds import (
    ANGLE,
    ANGLES,
    BRANCH,
    JOINTS,
    LENGTH,
    XYZ,
    Length,
    any_of,
    choice,
    defined,
    listed,
    mapping,
    number,
    vector,
)
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import YamlValue
from katana450.extensions.programs.language.step_target import StepTarget
from katana450.maths.geometry.arrays import FloatArray

ROOMIEST = "roomiest"
"""The word for the pitch that keeps the joints farthest from their limits along an arc."""

MIN_BLEND = 0.01
"""[1] Minimum rounding of a corner that is rounded."""

MAX_VIAS = 50
"""Maximum number of places of one step."""


def _place(value: YamlValue, context: ScriptContext) -> StepTarget:
    """Read the name of a pose, {joints: [...]}, or {x, y, z, pitch, roll, yaw, branch}."""
    if value.kind == "text":
        if value.held not in context.poses:
            known = ", ".join(context.poses) or "none"
            raise value.wrong(f"There is no pose {value}. Under `poses:` are: {known}.")
        return context.poses[str(value.held)]
    fields = Fields(value, "a place")
    if fields.has("joints"):
        target = StepTarget(joints=fields.take("joints", JOINTS, None))
    else:
        position = np.array([fields.need(name, LENGTH, 0.0) for name in XYZ])
        angles, branch = ANGLES.take(fields, context), fields.take("branch", BRANCH, None)
        target = StepTarget(None, position, angles, branch, context.in_base)
    fields.done()
    return target


def _point(value: YamlValue, context: ScriptContext) -> FloatArray:
    """Read a point (3,) [m]: {x, y, z}, [x, y, z], or the name of a pose that has one."""
    if value.kind != "text":
        return _COORDINATES(value, context)
    pose = _place(value, context)
    if pose.position is None:
        raise value.wrong(
            f"The pose {value} is given by joint angles, so it is no point. Use it in `move`, or "
            "give it by x, y and z."
        )
    return pose.position


def _pose(value: YamlValue, context: ScriptContext) -> StepTarget:
    """Read a point; a named pose also gives its orientation."""
    point = _point(value, context)
    if value.kind == "text":
        return _place(value, context)
    return StepTarget(None, point, in_base=context.in_base)


def _arc_pitch(value: YamlValue, context: ScriptContext) -> float | str | None:
    """Read a pitch: an angle [rad], ROOMIEST, or None for ``keep``."""
    if value.number is not None:
        return ANGLE(value, context)
    word = choice("keep", ROOMIEST)(value)
    return None if word == "keep" else word


def _blend(value: YamlValue, _context: ScriptContext) -> float:
    blend = number(0.0, 1.0)(value)
    if 0.0 < blend < MIN_BLEND:
        raise value.wrong(f"A blend is 0, or {MIN_BLEND:g} to 1: {blend:g} is too small to drive.")
    return blend


_COORDINATES = vector(LENGTH, "A point, mm: {x, y, z}, [x, y, z], or the name of a pose")
POINT = defined("point", Kind(_point, _COORDINATES.schema))
POSE = Kind(_pose, POINT.schema)
PLACE = defined(
    "place",
    Kind(
        _place,
        any_of(
            "A place: the name of a pose, angles of the joints, or a point with its orientation",
            {"type": "string"},
            mapping("Angles of the joints", "joints", {"joints": JOINTS.schema}),
            mapping(
                "A point with its orientation; what is absent stays",
                " ".join(XYZ),
                {
                    **dict.fromkeys(XYZ, LENGTH.schema),
                    **ANGLES.schemas,
                    "branch": BRANCH.schema,
                },
            ),
        ),
    ),
)
_PLACES = listed(PLACE, 2, MAX_VIAS)
THROUGH = defined(
    "through",
    Kind(_PLACES.read, any_of("Places in their order", _PLACES.schema, {"type": "string"})),
)
ARC_PITCH = Kind(
    _arc_pitch, any_of("Pitch of the tool, deg; roomiest is farthest from the limits", ANGLE.schema)
)
BLEND = Kind(
    _blend,
    number(
        0.0, 1.0, about="Fraction of half a leg that a corner cuts off; 0 rests in each corner"
    ).schema,
)

Point = Annotated[FloatArray, POINT]
Pose = Annotated[StepTarget, POSE]
Places = Annotated[tuple[StepTarget, ...], THROUGH]
"""Places that a step moves through."""
Blend = Annotated[float, BLEND]
"""Fraction of half a leg that a rounded corner cuts off; with 0 the tool rests in each corner."""


@dataclass(frozen=True)
class Spot(Declared):
    """Where an object is put down: its underside and its angle about the vertical.

    Attributes:
        x, y: [m].
        z: height of the underside [m]; NaN for that of whatever is below.
        yaw: angle about the vertical [rad]; None for any.
    """

    noun = "the place of an object"

    x: Length
    y: Length
    z: Annotated[float, LENGTH.about("Height of its underside, mm")] = math.nan
    yaw: Annotated[float | None, ANGLE.about("Angle about the vertical, deg")] = None


def _spot(value: YamlValue, context: ScriptContext) -> Spot:
    """Read {x, y, z, yaw}, or a point. Raises ScriptError."""
    if value.kind == "mapping":
        return Spot.read(value, context)
    return Spot(*POINT(value, context).tolist())


SPOT = Kind(
    _spot,
    any_of(
        "Its place: the name of a pose, [x, y, z], or x, y and, if wanted, z, yaw",
        {"type": "string"},
        POINT.schema,
        Spot.schema(),
    ),
)
