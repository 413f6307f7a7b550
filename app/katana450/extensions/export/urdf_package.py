"""A URDF with its meshes as a zip of a ROS package, to be unpacked into a workspace.

Programs differ in the files that they find and read. `package://` names are for ROS, yourdfpy and
PyBullet. PyBullet does not read glTF, so such meshes become OBJ, one file per material, and the
URDF names the colours. Drake refuses the STL of a collision, so collisions become OBJ too.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np

from katana450.arm.robot.surfaces import Material, VisualMesh, shapes_of
from katana450.arm.robot.visual import Visual, mesh_file
from katana450.assembly.robot_files import read_urdf
from katana450.errors import RobotDescriptionError
from katana450.extensions.export.files import distinct, zipped
from katana450.extensions.export.obj_text import LIBRARY, mtl_text, obj_text

CONVERTED = (".glb", ".gltf")
"""Suffixes of visual meshes that become OBJ; others are copied unchanged."""

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of an inertia."""

CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name} NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY {folders} DESTINATION share/${{PROJECT_NAME}})
ament_package()
"""
"""Template of CMakeLists.txt, which installs the folders."""

MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>{robot}: URDF and meshes</description>
  <maintainer email="todo@todo.todo">TODO: Maintainer</maintainer>
  <license>TODO: License declaration</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
"""Template of package.xml. Its placeholders are those of ROS's package generator."""


class _Part(NamedTuple):
    """A file of a mesh; ``material`` is the name of its only colour, in it and in the URDF."""

    stem: str
    suffix: str
    content: bytes
    material: str | None = None


def package_files(path: Path) -> dict[str, bytes]:
    """Return name and content of the zip of the URDF file at ``path``; see `packaged`."""
    files = packaged(path)
    package, _, _ = next(iter(files)).partition("/")
    return {f"{package}.zip": zipped(files, mode=0o644)}


def packaged(path: Path) -> dict[str, bytes]:
    """Return the content of each file of the package of the URDF file at ``path``.

    Their paths begin with the name of the package.

    Raises RobotDescriptionError if the file is not a URDF, or a mesh is missing or unreadable.
    """
    try:
        root = ET.XML(read_urdf(path), ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    except ET.ParseError as error:
        raise RobotDescriptionError(f"{path} is not a robot description: {error}.") from error
    robot = root.attrib["name"]
    (plain,) = distinct([robot])
    package = f"{plain.lower()}_description"
    _weigh_frames(root)
    meshes = _with_meshes(root, path.parent, f"package://{package}/")
    folders = "urdf meshes" if meshes else "urdf"
    files = {
        "package.xml": MANIFEST.format(name=package, robot=escape(robot)).encode(),
        "CMakeLists.txt": CMAKE.format(name=package, folders=folders).encode(),
        f"urdf/{plain}.urdf": ET.tostring(root, encoding="utf-8", xml_declaration=True),
        **meshes,
    }
    return {f"{package}/{name}": content for name, content in files.items()}


def _with_meshes(root: ET.Element, folder: Path, prefix: str) -> dict[str, bytes]:
    """Point the URDF ``root`` at copies of its meshes; return them by path in the package.

    ``folder`` is the folder of the URDF. ``prefix`` precedes a path in the URDF.
    """
    used = [
        (parent, element, mesh_file(mesh.get("filename", ""), folder))
        for parent in root.iter()
        for element in parent
        if element.tag in ("visual", "collision")
        for mesh in element.iterfind("geometry/mesh")
    ]
    if not used:
        return {}
    missing = [str(path) for path in dict.fromkeys(path for *_, path in used) if not path.is_file()]
    if missing:
        raise RobotDescriptionError(
            f"Nothing was written, because mesh files are missing: {', '.join(missing)}. Put them "
            "there, or remove their elements from the URDF."
        )
    # A mesh that is only copied is one file for visual and collision.
    keys = [
        (path, element.tag if _is_converted(path, element.tag) else None)
        for _, element, path in used
    ]
    shapes = {path: _triangles(path) for path, tag in dict.fromkeys(keys) if tag is not None}
    shown = dict.fromkeys(path for path, tag in keys if tag == "visual")
    names = _names(root, [shape.material for path in shown for shape in shapes[path]])
    groups = {
        (path, tag): _parts(
            path, None if tag is None else shapes[path], names if tag == "visual" else None
        )
        for path, tag in dict.fromkeys(keys)
    }
    stems = iter(distinct(part.stem for group in groups.values() for part in group))
    placed = {
        key: [(f"meshes/{next(stems)}{part.suffix}", part) for part in group]
        for key, group in groups.items()
    }
    for (parent, element, _), key in zip(used, keys, strict=True):
        index = list(parent).index(element)
        parent.remove(element)
        for k, (place, part) in enumerate(placed[key]):
            parent.insert(index + k, _pointed(element, prefix + place, part.material, k))
    for k, (material, name) in enumerate(names.items()):
        root.insert(k, _material(name, material))
    files = {place: part.content for group in placed.values() for place, part in group}
    if names:
        files[f"meshes/{LIBRARY}"] = mtl_text({n: m for m, n in names.items()}).encode()
    return files


def _is_converted(path: Path, tag: str) -> bool:
    """Return whether the mesh of an element of this ``tag`` becomes OBJ."""
    suffix = path.suffix.lower()
    return suffix in CONVERTED if tag == "visual" else suffix != ".obj"


def _triangles(path: Path) -> Sequence[VisualMesh]:
    """Return the surfaces of a mesh file. Raises RobotDescriptionError if there are none."""
    shapes = shapes_of(Visual(np.eye(4), np.ones(3), path))
    if not shapes:
        raise RobotDescriptionError(f"{path} has no triangles. Export the mesh again.")
    return shapes


def _names(root: ET.Element, materials: Sequence[Material]) -> dict[Material, str]:
    """Return a name for each of ``materials`` that is not used in the URDF or by another."""
    known = dict.fromkeys(element.get("name", "") for element in root.iter("material"))
    new = list(dict.fromkeys(materials))
    names = distinct([*known, *(material.name for material in new)])
    return dict(zip(new, names[len(known) :], strict=True))


def _parts(
    source: Path, shapes: Sequence[VisualMesh] | None, names: Mapping[Material, str] | None
) -> list[_Part]:
    """Return the files of a mesh: a copy, one OBJ, or with ``names`` one OBJ per material."""
    stem = f"{source.parent.name}_{source.stem}"
    if shapes is None:
        return [_Part(stem, source.suffix, source.read_bytes())]
    if names is None:
        return [_Part(stem, ".obj", obj_text(shapes, None).encode())]
    return [
        _Part(
            f"{stem}_{names[material]}",
            ".obj",
            obj_text([s for s in shapes if s.material == material], names[material]).encode(),
            names[material],
        )
        for material in dict.fromkeys(shape.material for shape in shapes)
    ]


def _pointed(element: ET.Element, name: str, material: str | None, number: int) -> ET.Element:
    """Return a copy of a visual or collision for the mesh ``name``, with a colour if it has none.

    ``number`` distinguishes the names of several copies.
    """
    copied = copy.deepcopy(element)
    for mesh in copied.iterfind("geometry/mesh"):
        mesh.set("filename", name)
    if number and copied.get("name"):
        copied.set("name", f"{copied.get('name')}_{number}")
    if material is not None and copied.find("material") is None:
        last = copied[-1]
        ET.SubElement(copied, "material", name=material).tail = last.tail
        last.tail = "\n      "
    return copied


def _material(name: str, material: Material) -> ET.Element:
    element = ET.Element("material", name=name)
    element.tail = "\n  "
    rgba = " ".join(f"{part:.4g}" for part in (*material.colour, 1.0))
    ET.SubElement(element, "color", rgba=rgba)
    return element


def _weigh_frames(root: ET.Element) -> None:
    """Set the mass of links without inertia on fixed joints to 0; PyBullet would assume 1 kg."""
    fixed = {
        child.get("link")
        for joint in root.iterfind("joint[@type='fixed']")
        for child in joint.iterfind("child")
    }
    for link in root.iterfind("link"):
        if link.get("name") in fixed and link.find("inertial") is None:
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value="0")
            ET.SubElement(inertial, "inertia", dict.fromkeys(MOMENTS, "0"))
