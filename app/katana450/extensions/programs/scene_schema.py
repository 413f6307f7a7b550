"""The JSON Schema of the scene of a script."""

from __future__ import annotations

from katana450.arm.control.scene_objects import MAX_OBJECTS, MAX_SCALE, MIN_SCALE, Shape
from katana450.arm.control.solid import MIN_OPACITY
from katana450.extensions.programs.scene_reader import MAX_WRITTEN_SIZE, UNITS, VERSION
from katana450.extensions.programs.schema_parts import (
    ANGLE,
    LENGTH,
    TEXT,
    TURN,
    Schema,
    any_of,
    list_of,
    mapping,
    number_or_text,
)

SIZE = number_or_text(0.0, MAX_WRITTEN_SIZE, "mm")

MESH = mapping(
    "A mesh file",
    "file",
    {
        "file": {**TEXT, "description": "File in the folder of the scene or below"},
        "unit": {"enum": list(UNITS), "description": "Unit of the file; guessed unless given"},
        "up": {"enum": ["y", "z"], "description": "Axis that points up"},
        "sha256": {**TEXT, "description": "SHA-256 of the file, which is then checked"},
    },
)

OBJECT = mapping(
    "An object",
    "name shape pose",
    {
        "name": {**TEXT, "description": "Its name"},
        "shape": {"enum": [each.value for each in Shape], "description": "Its shape"},
        "size": {
            **list_of(SIZE, 1, 3),
            "description": "mm. box: x, y, z; cylinder, vessel: radius, height; sphere: radius",
        },
        "mesh": MESH,
        "pose": {
            **list_of(any_of("mm or deg", LENGTH, TURN), 6, 6),
            "description": "x, y, z in mm, roll, pitch, yaw in deg, in the base frame",
        },
        "can_be_held": {"type": "boolean", "description": "Whether the fingers may grasp it"},
        "scale": number_or_text(MIN_SCALE, MAX_SCALE, "Factor on its size"),
        "colour": {**TEXT, "description": 'Like "#94a3b8", in quotes'},
        "opacity": number_or_text(MIN_OPACITY, 1.0, "1 is opaque"),
        "hidden": {"type": "boolean", "description": "Whether it is not drawn"},
        "attach": {"enum": ["hand", "world"], "description": "hand: it moves with the hand"},
    },
)

OBJECTS = {**list_of(OBJECT, 0, MAX_OBJECTS), "description": "The objects"}

SCENE: Schema = any_of(
    "The scene that the script needs: a file in its folder, or the objects",
    TEXT,
    OBJECTS,
    mapping(
        "A scene as in a scene file",
        "",
        {
            "scene": {"const": VERSION, "description": "Version of the format"},
            "joints": {**list_of(ANGLE, 1, 16), "description": "Posture at the start, deg"},
            "water": number_or_text(0.0, 10_000.0, "Water in the cup, ml"),
            "objects": OBJECTS,
        },
    ),
    {
        "description": "A file, with its text",
        "type": "object",
        "patternProperties": {r"\.ya?ml$": TEXT},
        "additionalProperties": False,
        "minProperties": 1,
    },
    {"type": "null"},
)
"""Schema of the field ``scene`` of a script."""
