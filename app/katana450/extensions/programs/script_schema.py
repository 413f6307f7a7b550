"""The JSON Schema of scripts, with which an editor completes, explains and checks their fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from katana450.arm.control.commands import MIN_SPEED
from katana450.extensions.programs.blocks import MAX_REPETITIONS, MAX_STEPS
from katana450.extensions.programs.fields import MAX_ANGLE, MAX_COORDINATE, XYZ
from katana450.extensions.programs.grasp import ABOVE, FRONT
from katana450.extensions.programs.measures import MEASURES
from katana450.extensions.programs.moves import MAX_VIAS
from katana450.extensions.programs.script import MAX_NAME_LENGTH
from katana450.extensions.programs.settings_steps import MAX_PAUSE
from katana450.maths.kinematics.branch import BRANCHES

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"

WITHOUT_VALUE = ("home", "release", "set_down")
"""Steps that take no value."""


def _ref(name: str, about: str = "") -> Schema:
    """Return a reference to a definition; ``about`` explains it at this place."""
    found = {"$ref": f"#/$defs/{name}"}
    return {**found, "description": about} if about else found


def _number(low: float, high: float, about: str) -> Schema:
    """Return a number, or a text that is computed."""
    return {
        "description": about,
        "anyOf": [{"type": "number", "minimum": low, "maximum": high}, {"type": "string"}],
    }


def _fields(about: str, required: str, properties: Mapping[str, Schema]) -> Schema:
    """Return a mapping with these fields only; ``required``: names of those that must be there."""
    return {
        "description": about,
        "type": "object",
        "properties": dict(properties),
        "required": required.split(),
        "additionalProperties": False,
    }


def _any_of(about: str, *options: Schema) -> Schema:
    return {"description": about, "anyOf": list(options)}


def _list(each: Schema, low: int, high: int) -> Schema:
    return {"type": "array", "items": each, "minItems": low, "maxItems": high}


TEXT: Schema = {"type": "string"}
LENGTH = _number(-MAX_COORDINATE, MAX_COORDINATE, "mm, or a text such as 4 cm or 2 * radius")
ANGLE = _number(-360.0, 360.0, "deg, or a text such as 0.5 rad")
TURN = _number(-MAX_ANGLE, MAX_ANGLE, "deg, or a text such as 0.5 rad")
PITCH = {**ANGLE, "description": "Pitch of the tool, deg: 0 is level, 90 points down"}
ROLL = {**ANGLE, "description": "Roll of the tool about its own axis, deg"}
BRANCH: Schema = {"enum": [str(each) for each in BRANCHES], "description": "Branch of the arm"}
OBJECT = {**TEXT, "description": "Name of an object"}
POINT_FIELDS = dict.fromkeys(XYZ, LENGTH)
ORIENTATION = {"pitch": PITCH, "roll": ROLL}
OFFSET = _any_of(
    "Motion of the tool point, mm; what is absent is 0",
    _list(LENGTH, 3, 3),
    _fields("x, y, z", "", POINT_FIELDS),
    TEXT,
)
BLEND = _number(0.0, 1.0, "Fraction of half a leg that a corner cuts off; 0 rests in each corner")
WITH: Schema = {"type": "object", "description": "Parameters and their values"}
ARC_PITCH = _any_of("Pitch of the tool, deg; roomiest is farthest from the limits", ANGLE)

BOUNDS_OF = {
    "at_least": _number(-1e9, 1e9, "Minimum"),
    "at_most": _number(-1e9, 1e9, "Maximum"),
}


def _grasp(about: str) -> Schema:
    """Return the name of an object, or how to grasp it."""
    how = {
        "side": {"enum": [FRONT, ABOVE], "description": "Side of the tool; found unless given"},
        "pitch": _number(0.0, 90.0, "Pitch of the tool, deg; found unless given"),
        "height": _number(1.0, 500.0, "Height above the underside, mm; found unless given"),
    }
    fields = _fields("An object, and how to grasp it", "object", {"object": OBJECT, **how})
    return _any_of(about, OBJECT, fields)


DEFINITIONS: dict[str, Schema] = {
    "point": _any_of(
        "A point, mm: {x, y, z}, [x, y, z], or the name of a pose",
        _fields("x, y, z", " ".join(XYZ), POINT_FIELDS),
        _list(LENGTH, 3, 3),
        TEXT,
    ),
    "direction": _any_of(
        "A direction: x, -y and so on, or three numbers",
        TEXT,
        _list(LENGTH, 3, 3),
        _fields("x, y, z", "", POINT_FIELDS),
    ),
    "joints": _any_of("Angles of the five joints, deg", _list(TURN, 5, 5), TEXT),
    "place": _any_of(
        "A place: the name of a pose, the angles of the joints, or a point with its orientation",
        TEXT,
        _fields("Angles of the joints", "joints", {"joints": _ref("joints")}),
        _fields(
            "A point with its orientation; what is absent stays",
            " ".join(XYZ),
            {**POINT_FIELDS, **ORIENTATION, "branch": BRANCH},
        ),
    ),
    "through": _any_of("Places in their order", _list(_ref("place"), 2, MAX_VIAS), TEXT),
    "steps": {
        "description": "Steps in their order",
        "type": "array",
        "items": _ref("step"),
        "minItems": 1,
        "maxItems": MAX_STEPS,
    },
}

STEP_VALUES: dict[str, Schema] = {
    "move": _any_of(
        "Move to a place on any path, round obstacles",
        _ref("place"),
        _fields(
            "Move relative to the present place",
            "by",
            {"by": OFFSET, **ORIENTATION, "branch": BRANCH},
        ),
    ),
    "joints": _ref("joints", "Move to these angles of the joints, deg, round obstacles"),
    "nudge": _fields(
        "Turn one joint by an angle",
        "axis by",
        {"axis": _number(1, 5, "Number of the joint, 1 to 5"), "by": TURN},
    ),
    "via": _fields(
        "Move the joints through places, with rounded corners",
        "through",
        {"through": _ref("through"), "blend": BLEND},
    ),
    "line": _fields(
        "Move the tool point on a straight line, to a point or by an offset",
        "",
        {"to": _ref("point"), "by": OFFSET, **ORIENTATION},
    ),
    "lines": _fields(
        "Move the tool point on straight lines through places, with rounded corners",
        "through",
        {"through": _ref("through"), "blend": BLEND},
    ),
    "arc": _fields(
        "Move the tool point round an axis from its present place",
        "centre axis angle",
        {
            "centre": _ref("point"),
            "axis": _ref("direction"),
            "angle": TURN,
            "climb": {**LENGTH, "description": "Motion along the axis, mm"},
            "pitch": ARC_PITCH,
            "roll": TURN,
        },
    ),
    "circle": _fields(
        "Move to the highest point of a circle, then round it",
        "centre normal radius",
        {
            "centre": _ref("point"),
            "normal": _ref("direction"),
            "radius": _number(0.1, 1000.0, "mm"),
            "turns": _number(-20.0, 20.0, "Number of turns, 1 unless given"),
            "pitch": ARC_PITCH,
            "roll": TURN,
            "branch": BRANCH,
        },
    ),
    "screw": _fields(
        "Move the tool about an axis and along it, as one rigid body",
        "point axis",
        {
            "point": _ref("point"),
            "axis": _ref("direction"),
            "angle": TURN,
            "climb": {**LENGTH, "description": "Motion along the axis, mm"},
        },
    ),
    "gripper": _number(
        -180.0, 180.0, "open, closed, or the angle of the fingers, deg; mm if they slide"
    ),
    "wait": _number(0.0, MAX_PAUSE, "Wait, s"),
    "tool": {**TEXT, "description": "Tool frame of all later points: tcp, grasp or flange"},
    "speed": _number(MIN_SPEED, 1.0, "Fraction of full speed of all later motions"),
    "put": _fields(
        "Set an object to another place on the table, without the arm",
        "object x y",
        {"object": OBJECT, "x": LENGTH, "y": LENGTH},
    ),
    "fill": _number(0.0, 1000.0, "Fill the cup with water, ml"),
    "grasp": _grasp("Open, approach an object, and close the fingers on it"),
    "pick": _grasp("Grasp an object, and lift it"),
    "place": {
        **_fields(
            "Put the held object down, and draw back",
            "",
            {
                "at": _any_of(
                    "Its place: the name of a pose, [x, y, z], or x, y and, if wanted, z, yaw",
                    TEXT,
                    _ref("point"),
                    _fields(
                        "Its place",
                        "x y",
                        {
                            "x": LENGTH,
                            "y": LENGTH,
                            "z": {**LENGTH, "description": "Height of its underside, mm"},
                            "yaw": {**TURN, "description": "Angle about the vertical, deg"},
                        },
                    ),
                ),
                "on": {**OBJECT, "description": "Object that carries it; its middle without `at`"},
            },
        ),
        "minProperties": 1,
    },
    "stack": _fields(
        "Pick an object and place it on the middle of another",
        "object on",
        {"object": OBJECT, "on": OBJECT},
    ),
    "pour": _any_of(
        "Carry the cup over an object, turn it over, shake it, and turn it back",
        OBJECT,
        _fields(
            "An object, and how much to pour",
            "into",
            {
                "into": OBJECT,
                "ml": _number(1.0, 1000.0, "How much to pour, ml; all unless given"),
                "shake": _number(0, 20, "Number of shakes after all is poured, 3 unless given"),
            },
        ),
    ),
    "repeat": _fields(
        "Repeat steps",
        "times steps",
        {
            "times": _number(1, MAX_REPETITIONS, "How often"),
            "index": {**TEXT, "description": "Name of the counter, from 0"},
            "steps": _ref("steps"),
        },
    ),
    "for_each": _fields(
        "Do steps once for each value of a list",
        "name in steps",
        {
            "name": {**TEXT, "description": "Name of the value in the steps"},
            "in": _any_of("The values", {"type": "array", "minItems": 1}, TEXT),
            "steps": _ref("steps"),
        },
    ),
    "call": _any_of(
        "Do the steps of a definition",
        TEXT,
        _fields("A definition, and its parameters", "name", {"name": TEXT, "with": WITH}),
    ),
    "wait_for": {
        **_fields(
            "Wait at rest until one condition holds",
            "",
            {
                "held": {**OBJECT, "description": "The fingers hold this object"},
                "placed": _fields(
                    "An object stands at a point",
                    "object at",
                    {
                        "object": OBJECT,
                        "at": _ref("point"),
                        "within": _number(0.1, 1000.0, "Distance, mm; 10 unless given"),
                    },
                ),
                "volume": _fields(
                    "Water in the cup or the basin, ml",
                    "of",
                    {"of": {"enum": ["cup", "basin"]}, **BOUNDS_OF},
                ),
                "joint": _fields(
                    "Angle of a joint, deg",
                    "axis",
                    {"axis": _number(1, 5, "Number of the joint, 1 to 5"), **BOUNDS_OF},
                ),
                "gripper": _fields(
                    "Angle of the fingers, deg, or their place, mm, if they slide", "", BOUNDS_OF
                ),
                "timeout": _number(0.01, MAX_PAUSE, "s; 60 unless given"),
            },
        ),
        "minProperties": 1,
        "maxProperties": 2,
    },
    "home": {"type": "null", "description": "Move to the ready posture"},
    "release": {
        "type": "null",
        "description": "Open the fingers on the held object where it is, and draw back",
    },
    "set_down": {
        "type": "null",
        "description": "Put the held object back to where it was grasped, and draw back",
    },
}
"""Schemas of the values of all steps, by the names of the steps."""

BOUNDS = _fields(
    "Bounds of a measure", "", {"at_least": {"type": "number"}, "at_most": {"type": "number"}}
)

TOP: dict[str, Schema] = {
    "name": {**TEXT, "maxLength": MAX_NAME_LENGTH, "description": "Name of the script"},
    "about": {**TEXT, "description": "Description for people"},
    "gripper": {
        "enum": ["fitted", "none"],
        "description": "none: for an arm without its gripper",
    },
    "frame": {
        "enum": ["shoulder", "base"],
        "description": "Frame of all points: shoulder, the {S} of the paper, or base, on the table",
    },
    "tool": {**TEXT, "description": "Tool frame of all points: tcp, grasp or flange"},
    "speed": _number(MIN_SPEED, 1.0, "Fraction of full speed"),
    "let": {
        "type": "object",
        "description": "Named values; later ones may use earlier ones",
    },
    "poses": {
        "type": "object",
        "description": "Named places; later ones may use the names of earlier ones",
        "additionalProperties": _ref("place"),
    },
    "define": {
        "type": "object",
        "description": "Named steps with parameters; each may call those above it",
        "additionalProperties": _fields(
            "Steps with parameters", "steps", {"with": WITH, "steps": _ref("steps")}
        ),
    },
    "steps": _ref("steps"),
    "expect": _fields(
        "Bounds on measures; a simulation that misses one ends with status 1",
        "",
        {name: {**BOUNDS, "description": about} for name, about in MEASURES.items()},
    ),
}
"""Schemas of the fields of a script, by their names."""


def script_schema() -> Schema:
    """Return the JSON Schema of a script.

    It accepts every valid script. What it cannot express, such as limits of the arm or the value of
    a computed number, only the reader of scripts refuses.
    """
    step = _any_of(
        "A step",
        {"enum": list(WITHOUT_VALUE)},
        {
            "type": "object",
            "properties": STEP_VALUES,
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        },
    )
    return {
        "$schema": DIALECT,
        "title": "Script of katana450",
        **_fields("Lengths are in mm, angles in deg, times in s.", "steps", TOP),
        "$defs": {**DEFINITIONS, "step": step},
    }
