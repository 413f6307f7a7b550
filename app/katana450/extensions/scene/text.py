"""Writing of a scene as YAML: lengths in mm, angles in degrees, poses in the base frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import yaml

from katana450.arm.control.scene_objects import SceneObject
from katana450.extensions.programs.script.scene_draft import VERSION, MeshFile, Scene
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import ML

LENGTH_DIGITS, ANGLE_DIGITS = 6, 9
"""Decimal places of written numbers [mm], [deg]: a millionth of a millimetre."""

HEAD = """\
# A scene of katana450. Lengths are in mm and angles in degrees. A pose is x, y, z, roll, pitch, yaw
# in the frame of the base, or in that of the tool for what is attached to the hand.
"""
"""Comment at the start of a written scene."""


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
