"""A scene as YAML: lengths in mm, angles in degrees, poses in the base frame."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import yaml

from katana450.arm.control.scene_objects import (
    MAX_COORDINATE,
    MAX_OBJECTS,
    MAX_SCALE,
    MIN_SCALE,
    SceneObject,
    Shape,
)
from katana450.arm.control.solid import MIN_OPACITY, Colour, ObjectAppearance
from katana450.extensions.programs.fields import Fields, choice, listed, millimetres, number, text
from katana450.extensions.programs.fields import degrees as read_degrees
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue, read
from katana450.extensions.scene.scene import MeshFile, Scene, SceneDraft, SceneEntry
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import ML

VERSION = 1
"""Version of the format."""

LENGTH_DIGITS, ANGLE_DIGITS = 6, 9
"""Decimal places of written numbers [mm], [deg]: a millionth of a millimetre."""

HEAD = """\
# A scene of katana450. Lengths are in mm and angles in degrees. A pose is x, y, z, roll, pitch, yaw
# in the frame of the base, or in that of the tool for what is attached to the hand.
"""
"""Comment at the start of a written scene."""

UNITS = ("mm", "cm", "in", "m")
"""Units of a mesh file."""

COLOUR = re.compile(r"#[0-9a-f]{6}")
"""Pattern of a colour, in lower case."""

MAX_WRITTEN_SIZE = 4000.0
"""[mm] Maximum size in a text."""


def parsed(source: str) -> SceneDraft:
    """Return a text as a draft. Raises ScriptError with all errors, line by line."""
    fields = Fields(read(source, "scene"), "a scene")
    version = fields.need("scene", number(1, 1000), VERSION)
    if version != VERSION:
        raise fields.value.wrong(f"The version must be {VERSION}, not {version:g}.")
    joints = fields.take("joints", listed(read_degrees(), 1, 16), None)
    water = fields.take("water", number(0.0, 10_000.0, "ml"), None)
    entries = fields.take("objects", listed(_entry, 0, MAX_OBJECTS), ())
    fields.problems += _twice(entries)
    fields.done()
    return SceneDraft(
        entries,
        None if water is None else ML * water,
        None if joints is None else np.array(joints),
    )


def written(scene: Scene, files: Mapping[str, MeshFile], T_palm_tool: FloatArray | None) -> str:
    """Return the text of a scene. ``files`` are the files of its meshes by their keys."""
    entry: dict[str, object] = {"scene": VERSION}
    if scene.joints is not None:
        entry["joints"] = [_round(each, ANGLE_DIGITS) for each in np.degrees(scene.joints)]
    if scene.water is not None:
        entry["water"] = _round(scene.water / ML, LENGTH_DIGITS)
    entry["objects"] = [
        _object_entry(scene_object, files, T_palm_tool) for scene_object in scene.objects
    ]
    body: str = yaml.dump(entry, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return HEAD + body


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]  # PyYAML has no types
    """A YAML dumper that writes lists of numbers on one line."""

    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002
        """Return True, so that repeated values are written in full."""
        return True

    def represent_list(self, data: list[object]) -> yaml.Node:
        """Return the node of a list; a list of numbers is on one line."""
        plain = all(isinstance(each, int | float) for each in data)
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=plain)


_Dumper.add_representer(list, _Dumper.represent_list)


def _object_entry(
    scene_object: SceneObject, files: Mapping[str, MeshFile], T_palm_tool: FloatArray | None
) -> dict[str, object]:
    entry: dict[str, object] = {"name": scene_object.name, "shape": scene_object.shape.value}
    T = scene_object.T
    if scene_object.fixed and T_palm_tool is not None:
        T = se3.inverse(T_palm_tool) @ T
    if scene_object.solid is None:
        entry["size"] = [_round(1e3 * each, LENGTH_DIGITS) for each in scene_object.size]
    else:
        file = files[scene_object.solid.key]
        values = {"file": file.path, "unit": file.unit, "up": file.up, "sha256": file.sha256}
        entry["mesh"] = {name: each for name, each in values.items() if each is not None}
    entry["pose"] = [
        *(_round(1e3 * each, LENGTH_DIGITS) for each in T[:3, 3]),
        *(_round(each, ANGLE_DIGITS) for each in np.degrees(so3.to_rpy(T[:3, :3]))),
    ]
    scale, opacity = (
        float(f"{each:.12g}") for each in (scene_object.scale, scene_object.appearance.opacity)
    )
    if scale != 1.0:
        entry["scale"] = scale
    if scene_object.appearance.colour is not None:
        entry["colour"] = "#{:02x}{:02x}{:02x}".format(*scene_object.appearance.colour)
    if opacity != 1.0:
        entry["opacity"] = opacity
    for name, true in (
        ("hidden", scene_object.appearance.hidden),
        ("can_be_held", scene_object.can_be_held),
    ):
        if true:
            entry[name] = True
    if scene_object.fixed:
        entry["attach"] = "hand"
    return entry


def _round(value: float, digits: int) -> int | float:
    rounded = round(float(value), digits) + 0.0
    return int(rounded) if rounded == int(rounded) else rounded


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


__all__ = ["ScriptError", "parsed", "written"]
