"""Reading of a scene from YAML: lengths in mm, angles in degrees, poses in the base frame."""

from __future__ import annotations

import re

import numpy as np

from katana450.arm.control.scene_objects import (
    MAX_COORDINATE,
    MAX_OBJECTS,
    MAX_SCALE,
    MIN_SCALE,
    Shape,
)
from katana450.arm.control.solid import MIN_OPACITY, Colour, ObjectAppearance
from katana450.extensions.programs.fields import Fields, choice, listed, millimetres, number, text
from katana450.extensions.programs.fields import degrees as read_degrees
from katana450.extensions.programs.scene_draft import MeshFile, SceneDraft, SceneEntry
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue, read
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import ML

VERSION = 1
"""Version of the format."""

UNITS = ("mm", "cm", "in", "m")
"""Units of a mesh file."""

COLOUR = re.compile(r"#[0-9a-f]{6}")
"""Pattern of a colour, in lower case."""

MAX_WRITTEN_SIZE = 4000.0
"""[mm] Maximum size in a text."""


def parsed(source: str, file: str = "") -> SceneDraft:
    """Return a text as a draft. Raises ScriptError with all errors, line by line.

    ``file`` is the name of its file, if a script names it.
    """
    return scene_draft(read(source, "scene", file), versioned=True)


def scene_draft(value: YamlValue, *, versioned: bool) -> SceneDraft:
    """Return a mapping as a draft. Raises ScriptError with all errors.

    ``versioned``: whether the mapping must have the version of the format.
    """
    fields = Fields(value, "a scene")
    version = (fields.need if versioned else fields.take)("scene", number(1, 1000), VERSION)
    if version != VERSION:
        raise fields.value.wrong(f"The version must be {VERSION}, not {version:g}.")
    joints = fields.take("joints", listed(read_degrees(), 1, 16), None)
    water = fields.take("water", number(0.0, 10_000.0, "ml"), None)
    entries = fields.take("objects", scene_entries, ())
    fields.done()
    return SceneDraft(
        entries,
        None if water is None else ML * water,
        None if joints is None else np.array(joints),
    )


def scene_entries(value: YamlValue) -> tuple[SceneEntry, ...]:
    """Read a list of objects. Raises ScriptError."""
    entries = listed(_entry, 0, MAX_OBJECTS)(value)
    if twice := _twice(entries):
        raise ScriptError(tuple(twice))
    return entries


def _entry(value: YamlValue) -> SceneEntry:
    fields = Fields(value, "an object")
    shape_name = fields.need("shape", choice(*(each.value for each in Shape)), "")
    shape = Shape(shape_name) if shape_name else Shape.BOX
    size: tuple[float, ...] = ()
    mesh = None
    if not shape_name:
        # Without a shape, `size` and `mesh` are both accepted.
        fields.has("size")
        fields.has("mesh")
    elif shape is Shape.MESH:
        mesh = fields.need("mesh", _mesh, None)
    else:
        count = shape.numbers
        size = fields.need("size", listed(millimetres(0.0, MAX_WRITTEN_SIZE), count, count), ())
    found = SceneEntry(
        value,
        fields.need("name", text, ""),
        shape,
        size,
        fields.need("pose", _pose, np.eye(4)),
        fields.take("can_be_held", _true, False),
        mesh,
        fields.take("scale", number(MIN_SCALE, MAX_SCALE), 1.0),
        ObjectAppearance(
            fields.take("colour", _colour, None),
            fields.take("opacity", number(MIN_OPACITY, 1.0), 1.0),
            fields.take("hidden", _true, False),
        ),
        fields.take("attach", choice("hand", "world"), "world") == "hand",
    )
    fields.done()
    return found


def _mesh(value: YamlValue) -> MeshFile:
    fields = Fields(value, "a mesh")
    found = MeshFile(
        fields.need("file", text, ""),
        fields.take("unit", choice(*UNITS), None),
        fields.take("up", choice("y", "z"), None),
        fields.take("sha256", _digest, None),
    )
    fields.done()
    return found


def _pose(value: YamlValue) -> FloatArray:
    """Return the pose (4, 4) [m] of six numbers."""
    if value.kind != "list" or len(value.items) != 6:
        raise value.wrong("A pose must be six numbers: x, y, z in mm, roll, pitch, yaw in degrees.")
    # In the frame of the tool, coordinates of a valid place can be larger.
    farthest = 2e3 * MAX_COORDINATE
    lengths = [millimetres(-farthest, farthest)(each) for each in value.items[:3]]
    angles = [read_degrees()(each) for each in value.items[3:]]
    return se3.from_rotation_translation(so3.from_rpy(*angles), lengths)


def _colour(value: YamlValue) -> Colour:
    word = str(value.held).lower()
    if not COLOUR.fullmatch(word):
        raise value.wrong(f'A colour must be like "#94a3b8", in quotes, not {value}.')
    red, green, blue = bytes.fromhex(word[1:])
    return red, green, blue


def _digest(value: YamlValue) -> str:
    if not re.fullmatch(r"[0-9a-f]{64}", str(value.held)):
        raise value.wrong("A SHA-256 must have 64 digits from 0 to f.")
    return str(value.held)


def _true(value: YamlValue) -> bool:
    word = str(value.held).lower()
    if word not in ("true", "false", "yes", "no"):
        raise value.wrong(f"Expected true or false, not {value}.")
    return word in ("true", "yes")


def _twice(entries: tuple[SceneEntry, ...]) -> list[Problem]:
    seen: set[str] = set()
    problems: list[Problem] = []
    for entry in entries:
        if entry.name in seen:
            problems += entry.at.wrong(f"There are two objects called {entry.name!r}.").problems
        seen.add(entry.name)
    return problems
