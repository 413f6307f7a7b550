"""The JSON Schema of scripts, with which an editor completes, explains and checks their fields."""

from __future__ import annotations

from katana450.arm.control.commands import MIN_SPEED
from katana450.extensions.programs.attached_files import MAX_FILES
from katana450.extensions.programs.blocks import MAX_REPETITIONS, MAX_STEPS
from katana450.extensions.programs.fields import XYZ
from katana450.extensions.programs.measures import MEASURES
from katana450.extensions.programs.moves import MAX_VIAS
from katana450.extensions.programs.places import LEAST_JOINTS, MAX_JOINTS
from katana450.extensions.programs.scene_schema import SCENE
from katana450.extensions.programs.schema_parts import (
    BOUNDS_OF,
    BRANCH,
    CONDITION_FIELDS,
    LENGTH,
    OBJECT,
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
from katana450.extensions.programs.steps import STEPS
from katana450.extensions.programs.trajectory import MAX_TIME

DIALECT = "https://json-schema.org/draft/2020-12/schema"

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

CHOICE_FIELDS = {
    **CONDITION_FIELDS,
    "time": mapping("Time since the program began, s", "", BOUNDS_OF),
}
"""Schemas of the conditions of an ``if`` and an ``until``, by their names."""

BLOCK_VALUES: dict[str, Schema] = {
    "stack": mapping(
        "Pick an object and place it on the middle of another",
        "object on",
        {"object": OBJECT, "on": OBJECT},
    ),
    "repeat": mapping(
        "Repeat steps",
        "times steps",
        {
            "times": number_or_text(1, MAX_REPETITIONS, "How often; with `until`, at most"),
            "until": {
                **mapping("Repeat until this holds after the steps", "", CHOICE_FIELDS),
                "minProperties": 1,
                "maxProperties": 1,
            },
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
    "if": {
        **mapping(
            "Steps that depend on one condition, which is measured when the step is reached",
            "then",
            {
                **CHOICE_FIELDS,
                "then": reference("steps", "Steps if the condition holds"),
                "else": reference("steps", "Steps if it does not hold"),
            },
        ),
        "minProperties": 2,
        "maxProperties": 3,
    },
}
"""Schemas of the values of what stands for several steps, by their names."""

STEP_VALUES: dict[str, Schema] = {
    **{name: kind.schema for name, kind in STEPS.items()},
    **BLOCK_VALUES,
}
"""Schemas of the values of all steps, by the names of the steps."""

WITHOUT_VALUE = tuple(name for name, value in STEP_VALUES.items() if value.get("type") == "null")
"""Steps that take no value."""

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
