"""The JSON Schema of scripts, with which an editor completes, explains and checks their fields."""

from __future__ import annotations

from katana450.arm.control.commands import MIN_SPEED
from katana450.extensions.programs.approach import ABOVE, FRONT
from katana450.extensions.programs.attached_files import MAX_FILES
from katana450.extensions.programs.blocks import MAX_REPETITIONS, MAX_STEPS
from katana450.extensions.programs.fields import XYZ
from katana450.extensions.programs.grip_until import MAX_FORCE, MIN_FORCE
from katana450.extensions.programs.measures import MEASURES
from katana450.extensions.programs.moves import MAX_VIAS
from katana450.extensions.programs.places import LEAST_JOINTS, MAX_JOINTS
from katana450.extensions.programs.scene_schema import SCENE
from katana450.extensions.programs.schema_parts import (
    ARC_PITCH,
    BLEND,
    BOUNDS_OF,
    BRANCH,
    CONDITION_FIELDS,
    LENGTH,
    OBJECT,
    OFFSET,
    ORIENTATION,
    POINT_FIELDS,
    TEXT,
    TURN,
    WITH,
    Schema,
    any_of,
    list_of,
    mapping,
    number_or_text,
    reference,
)
from katana450.extensions.programs.script import MAX_NAME_LENGTH
from katana450.extensions.programs.settings_steps import MAX_PAUSE
from katana450.extensions.programs.trajectory import MAX_POSTURES, MAX_TIME
from katana450.maths.water.liquid import LIQUIDS

DIALECT = "https://json-schema.org/draft/2020-12/schema"

WITHOUT_VALUE = ("home", "release", "set_down")
"""Steps that take no value."""


def _grasp(about: str) -> Schema:
    """Return the name of an object, or how to grasp it."""
    how = {
        "side": {"enum": [FRONT, ABOVE], "description": "Side of the tool; found unless given"},
        "pitch": number_or_text(0.0, 90.0, "Pitch of the tool, deg; found unless given"),
        "height": number_or_text(1.0, 500.0, "Height above the underside, mm; found unless given"),
    }
    fields = mapping("An object, and how to grasp it", "object", {"object": OBJECT, **how})
    return any_of(about, OBJECT, fields)


FINGERS = number_or_text(
    -180.0, 180.0, "open, closed, or the angle of the fingers, deg; mm if they slide"
)

DEFINITIONS: dict[str, Schema] = {
    "posture": list_of(
        number_or_text(-MAX_TIME, MAX_TIME, "A time, s, then the angles of all joints, deg"),
        1 + LEAST_JOINTS,
        1 + MAX_JOINTS,
    ),
    "point": any_of(
        "A point, mm: {x, y, z}, [x, y, z], or the name of a pose",
        mapping("x, y, z", " ".join(XYZ), POINT_FIELDS),
        list_of(LENGTH, 3, 3),
        TEXT,
    ),
    "direction": any_of(
        "A direction: x, -y and so on, or three numbers",
        TEXT,
        list_of(LENGTH, 3, 3),
        mapping("x, y, z", "", POINT_FIELDS),
    ),
    "joints": any_of("Angles of all joints, deg", list_of(TURN, LEAST_JOINTS, MAX_JOINTS), TEXT),
    "place": any_of(
        "A place: the name of a pose, the angles of the joints, or a point with its orientation",
        TEXT,
        mapping("Angles of the joints", "joints", {"joints": reference("joints")}),
        mapping(
            "A point with its orientation; what is absent stays",
            " ".join(XYZ),
            {**POINT_FIELDS, **ORIENTATION, "branch": BRANCH},
        ),
    ),
    "through": any_of("Places in their order", list_of(reference("place"), 2, MAX_VIAS), TEXT),
    "steps": {
        "description": "Steps in their order",
        "type": "array",
        "items": reference("step"),
        "minItems": 1,
        "maxItems": MAX_STEPS,
    },
}

STEP_VALUES: dict[str, Schema] = {
    "move": any_of(
        "Move to a place on any path, round obstacles",
        reference("place"),
        mapping(
            "Move relative to the present place",
            "by",
            {"by": OFFSET, **ORIENTATION, "branch": BRANCH},
        ),
    ),
    "joints": reference("joints", "Move to these angles of the joints, deg, round obstacles"),
    "nudge": mapping(
        "Turn one joint by an angle",
        "axis by",
        {"axis": number_or_text(1, MAX_JOINTS, "Number of the joint, from 1"), "by": TURN},
    ),
    "via": mapping(
        "Move the joints through places, with rounded corners",
        "through",
        {"through": reference("through"), "blend": BLEND},
    ),
    "line": mapping(
        "Move the tool point on a straight line, to a point or by an offset",
        "",
        {"to": reference("point"), "by": OFFSET, **ORIENTATION},
    ),
    "lines": mapping(
        "Move the tool point on straight lines through places, with rounded corners",
        "through",
        {"through": reference("through"), "blend": BLEND},
    ),
    "arc": mapping(
        "Move the tool point round an axis from its present place",
        "centre axis angle",
        {
            "centre": reference("point"),
            "axis": reference("direction"),
            "angle": TURN,
            "climb": {**LENGTH, "description": "Motion along the axis, mm"},
            "pitch": ARC_PITCH,
            "roll": TURN,
            "yaw": TURN,
        },
    ),
    "circle": mapping(
        "Move to the highest point of a circle, then round it",
        "centre normal radius",
        {
            "centre": reference("point"),
            "normal": reference("direction"),
            "radius": number_or_text(0.1, 1000.0, "mm"),
            "turns": number_or_text(-20.0, 20.0, "Number of turns, 1 unless given"),
            "pitch": ARC_PITCH,
            "roll": TURN,
            "yaw": TURN,
            "branch": BRANCH,
        },
    ),
    "screw": mapping(
        "Move the tool about an axis and along it, as one rigid body",
        "point axis",
        {
            "point": reference("point"),
            "axis": reference("direction"),
            "angle": TURN,
            "climb": {**LENGTH, "description": "Motion along the axis, mm"},
        },
    ),
    "gripper": any_of(
        "open, closed, or the angle of the fingers, deg; mm if they slide",
        FINGERS,
        mapping(
            "A position of the fingers, and what they must hold then",
            "to",
            {"to": FINGERS, "holding": OBJECT},
        ),
    ),
    "grip": mapping(
        "Close the fingers until they press with a force",
        "until",
        {
            "until": number_or_text(MIN_FORCE, MAX_FORCE, "Force of a finger, N, such as 3 N"),
            "holding": OBJECT,
        },
    ),
    "trajectory": mapping(
        "Move through postures at given times, on a smooth path, slower where limits require it",
        "through",
        {"through": list_of(reference("posture"), 2, MAX_POSTURES)},
    ),
    "wait": number_or_text(0.0, MAX_PAUSE, "Wait, s"),
    "tool": {**TEXT, "description": "Tool frame of all later points: tcp, grasp or flange"},
    "speed": number_or_text(MIN_SPEED, 1.0, "Fraction of full speed of all later motions"),
    "put": mapping(
        "Set an object to another place on the table, without the arm",
        "object x y",
        {"object": OBJECT, "x": LENGTH, "y": LENGTH},
    ),
    "fill": any_of(
        "Fill the cup with water, ml, or with another liquid",
        number_or_text(0.0, 1000.0, "Volume of water, ml"),
        mapping(
            "A volume, and of which liquid",
            "ml",
            {
                "ml": number_or_text(0.0, 1000.0, "Volume, ml"),
                "of": {"enum": list(LIQUIDS), "description": "The liquid, water unless given"},
            },
        ),
    ),
    "grasp": _grasp("Open, approach an object, and close the fingers on it"),
    "pick": _grasp("Grasp an object, and lift it"),
    "place": {
        **mapping(
            "Put the held object down, and draw back",
            "",
            {
                "at": any_of(
                    "Its place: the name of a pose, [x, y, z], or x, y and, if wanted, z, yaw",
                    TEXT,
                    reference("point"),
                    mapping(
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
    "stack": mapping(
        "Pick an object and place it on the middle of another",
        "object on",
        {"object": OBJECT, "on": OBJECT},
    ),
    "pour": any_of(
        "Carry the cup over an object, turn it over, shake it, and turn it back",
        OBJECT,
        mapping(
            "An object, and how much to pour",
            "into",
            {
                "into": OBJECT,
                "ml": number_or_text(1.0, 1000.0, "How much to pour, ml; all unless given"),
                "rate": number_or_text(
                    1.0, 50.0, "Flow while pouring, ml/s, or a text such as 10 ml/s"
                ),
                "shake": number_or_text(
                    0, 20, "Number of shakes after all is poured, 3 unless given"
                ),
            },
        ),
    ),
    "repeat": mapping(
        "Repeat steps",
        "times steps",
        {
            "times": number_or_text(1, MAX_REPETITIONS, "How often"),
            "index": {**TEXT, "description": "Name of the counter, from 0"},
            "steps": reference("steps"),
        },
    ),
    "for_each": mapping(
        "Do steps once for each value of a list",
        "name in steps",
        {
            "name": {**TEXT, "description": "Name of the value in the steps"},
            "in": any_of("The values", {"type": "array", "minItems": 1}, TEXT),
            "steps": reference("steps"),
        },
    ),
    "call": any_of(
        "Do the steps of a definition",
        TEXT,
        mapping("A definition, and its parameters", "name", {"name": TEXT, "with": WITH}),
    ),
    "wait_for": {
        **mapping(
            "Wait at rest until one condition holds",
            "",
            {
                **CONDITION_FIELDS,
                "timeout": number_or_text(0.01, MAX_PAUSE, "s; 60 unless given"),
            },
        ),
        "minProperties": 1,
        "maxProperties": 2,
    },
    "if": {
        **mapping(
            "Steps that depend on one condition, which is measured when the step is reached",
            "then",
            {
                **CONDITION_FIELDS,
                "time": mapping("Time since the program began, s", "", BOUNDS_OF),
                "then": reference("steps", "Steps if the condition holds"),
                "else": reference("steps", "Steps if it does not hold"),
            },
        ),
        "minProperties": 2,
        "maxProperties": 3,
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

BOUNDS = mapping(
    "Bounds of a measure", "", {"at_least": {"type": "number"}, "at_most": {"type": "number"}}
)

FILE = any_of(
    "A file, or a mapping of its name to its text",
    TEXT,
    {"type": "object", "additionalProperties": TEXT, "minProperties": 1},
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
    "speed": number_or_text(MIN_SPEED, 1.0, "Fraction of full speed"),
    "scene": SCENE,
    "include": any_of(
        "Files in the folder of the script, from which `let`, `poses` and `define` are taken",
        FILE,
        list_of(FILE, 1, MAX_FILES),
    ),
    "let": {
        "type": "object",
        "description": "Named values; later ones may use earlier ones",
    },
    "poses": {
        "type": "object",
        "description": "Named places; later ones may use the names of earlier ones",
        "additionalProperties": reference("place"),
    },
    "define": {
        "type": "object",
        "description": "Named steps with parameters; each may call those above it",
        "additionalProperties": mapping(
            "Steps with parameters", "steps", {"with": WITH, "steps": reference("steps")}
        ),
    },
    "steps": reference("steps"),
    "expect": mapping(
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
    step = any_of(
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
        **mapping("Lengths are in mm, angles in deg, times in s.", "steps", TOP),
        "$defs": {**DEFINITIONS, "step": step},
    }
