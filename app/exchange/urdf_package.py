"""A URDF with its meshes as a zip of a ROS package, to be unpacked into a workspace."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import escape

from app.errors import RobotDescriptionError
from app.exchange.names import distinct
from app.robot.visual import mesh_file

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Of every file in the zip, so that the same robot gives the same bytes."""

CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name} NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY urdf meshes DESTINATION share/${{PROJECT_NAME}})
ament_package()
"""

MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>URDF and meshes of {robot}</description>
  <maintainer email="nobody@example.org">nobody</maintainer>
  <license>{licence}</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""


def package_files(path: Path, licence: str = "unknown") -> dict[str, bytes]:
    """Name and content of the one zip of the URDF file at `path`.

    Meshes are copied, and named as `package://`. Raises RobotDescriptionError for a file that is
    none, and for a mesh that is not there.
    """
    try:
        tree = ET.parse(path, parser=ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    except (OSError, ET.ParseError) as error:
        raise RobotDescriptionError(f"{path} is not a robot description: {error}.") from error
    root = tree.getroot()
    robot = root.get("name", "")
    if root.tag != "robot" or not robot:
        raise RobotDescriptionError(f"{path} is not a robot description: it names no robot.")
    package = f"{distinct([robot])[0].lower()}_description"
    elements = [mesh for mesh in root.iter("mesh") if mesh.get("filename")]
    sources: dict[Path, None] = {}
    for element in elements:
        source = mesh_file(element.get("filename", ""), path.parent)
        if not source.is_file():
            raise RobotDescriptionError(f"There is no mesh at {source}.")
        sources.setdefault(source)
    inside = dict(zip(sources, _places(sources), strict=True))
    for element in elements:
        source = mesh_file(element.get("filename", ""), path.parent)
        element.set("filename", f"package://{package}/{inside[source]}")
    files = {
        "package.xml": MANIFEST.format(
            name=package, robot=escape(robot), licence=escape(licence)
        ).encode(),
        "CMakeLists.txt": CMAKE.format(name=package).encode(),
        f"urdf/{distinct([robot])[0]}.urdf": ET.tostring(
            root, encoding="utf-8", xml_declaration=True
        ),
        **{place: source.read_bytes() for source, place in inside.items()},
    }
    return {f"{package}.zip": _zipped({f"{package}/{n}": c for n, c in files.items()})}


def _places(sources: Iterable[Path]) -> list[str]:
    """A path in the package for each mesh: its own folder's and file's names, none alike."""
    stems = distinct(f"{source.parent.name}_{source.stem}" for source in sources)
    return [f"meshes/{stem}{s.suffix}" for stem, s in zip(stems, sources, strict=True)]


def _zipped(files: dict[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return made.getvalue()
