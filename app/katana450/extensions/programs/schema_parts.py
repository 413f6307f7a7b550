"""Parts of the JSON Schemas of scripts and scenes: numbers with units, points and conditions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from katana450.extensions.general_arms.branch_words import BRANCH_NAMES
from katana450.extensions.programs.fields import MAX_ANGLE, MAX_COORDINATE, XYZ
from katana450.extensions.programs.places import MAX_JOINTS

Schema = dict[str, Any]


def reference(name: str, about: str = "") -> Schema:
    """Return a reference to a definition; ``about`` explains it at this place."""
    found = {"$ref": f"#/$defs/{name}"}
    return {**found, "description": about} if about else found


def number_or_text(low: float, high: float, about: str) -> Schema:
    """Return a number, or a text that is computed."""
    return {
        "description": about,
        "anyOf": [{"type": "number", "minimum": low, "maximum": high}, {"type": "string"}],
    }


def mapping(about: str, required: str, properties: Mapping[str, Schema]) -> Schema:
    """Return a mapping with these fields only; ``required``: names of those that must be there."""
    return {
        "description": about,
        "type": "object",
        "properties": dict(properties),
        "required": required.split(),
        "additionalProperties": False,
    }


def any_of(about: str, *options: Schema) -> Schema:
    """Return one of ``options``."""
    return {"description": about, "anyOf": list(options)}


def list_of(each: Schema, low: int, high: int) -> Schema:
    """Return a list of ``low`` to ``high`` values like ``each``."""
    return {"type": "array", "items": each, "minItems": low, "maxItems": high}


TEXT: Schema = {"type": "string"}
LENGTH = number_or_text(-MAX_COORDINATE, MAX_COORDINATE, "mm, or a text such as 4 cm or 2 * radius")
ANGLE = number_or_text(-360.0, 360.0, "deg, or a text such as 0.5 rad")
TURN = number_or_text(-MAX_ANGLE, MAX_ANGLE, "deg, or a text such as 0.5 rad")
PITCH = {**ANGLE, "description": "Pitch of the tool, deg: 0 is level, 90 points down"}
ROLL = {**ANGLE, "description": "Roll of the tool about its own axis, deg"}
YAW = {**ANGLE, "description": "Yaw of the tool, deg, of arms with six or more axes"}
BRANCH: Schema = {"enum": list(BRANCH_NAMES), "description": "Branch of the arm"}
OBJECT = {**TEXT, "description": "Name of an object"}
POINT_FIELDS = dict.fromkeys(XYZ, LENGTH)
ORIENTATION = {"pitch": PITCH, "roll": ROLL, "yaw": YAW}
OFFSET = any_of(
    "Motion of the tool point, mm; what is absent is 0",
    list_of(LENGTH, 3, 3),
    mapping("x, y, z", "", POINT_FIELDS),
    TEXT,
)
BLEND = number_or_text(
    0.0, 1.0, "Fraction of half a leg that a corner cuts off; 0 rests in each corner"
)
FEED = number_or_text(0.1, 1000.0, "Speed of the tool point, mm/s; slower where limits require it")
WITH: Schema = {"type": "object", "description": "Parameters and their values"}
ARC_PITCH = any_of("Pitch of the tool, deg; roomiest is farthest from the limits", ANGLE)

BOUNDS_OF = {
    "at_least": number_or_text(-1e9, 1e9, "Minimum"),
    "at_most": number_or_text(-1e9, 1e9, "Maximum"),
}


CONDITION_FIELDS: dict[str, Schema] = {
    "held": {**OBJECT, "description": "The fingers hold this object"},
    "placed": mapping(
        "An object stands at a point",
        "object at",
        {
            "object": OBJECT,
            "at": reference("point"),
            "within": number_or_text(0.1, 1000.0, "Distance, mm; 10 unless given"),
        },
    ),
    "volume": mapping(
        "Water in the cup, the basin or another vessel, ml",
        "of",
        {"of": OBJECT, **BOUNDS_OF},
    ),
    "joint": mapping(
        "Angle of a joint, deg",
        "axis",
        {"axis": number_or_text(1, MAX_JOINTS, "Number of the joint, from 1"), **BOUNDS_OF},
    ),
    "gripper": mapping(
        "Angle of the fingers, deg, or their place, mm, if they slide", "", BOUNDS_OF
    ),
    "tool": {
        **mapping(
            "Coordinates of the tool point, mm",
            "",
            {name: mapping(f"Bounds of {name}", "", BOUNDS_OF) for name in XYZ},
        ),
        "minProperties": 1,
    },
}
"""Schemas of the conditions on the state, by their names."""
