"""The robot's description as its text in /robot_description, and the meshes that it names.

The meshes are those of the exported package for ROS 2: OBJ files, one for each colour. Their
addresses hold a secret of this server, because viewers load meshes without cookies and headers. A
client that has received the description can load them.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from katana450.extensions.export.urdf_package import package_files

MESHES = "/rosbridge/meshes"
"""Path of the meshes; the secret and the name of a file follow."""

TYPES = {
    ".obj": "model/obj",
    ".mtl": "model/mtl",
    ".stl": "model/stl",
    ".dae": "model/vnd.collada+xml",
    ".glb": "model/gltf-binary",
    ".gltf": "model/gltf+json",
    ".png": "image/png",
    ".jpg": "image/jpeg",
}
"""Types of the files by their suffixes."""


class RobotPackage(NamedTuple):
    """A robot's description with its files.

    Attributes:
        text: the URDF; its meshes have the prefix ``package``.
        package: prefix of the meshes, ``package://NAME/``.
        files: content of each file by its path in the package.
        key: secret in the addresses of the files.
    """

    text: str
    package: str
    files: dict[str, bytes]
    key: str

    @classmethod
    def read(cls, urdf: Path, key: str) -> RobotPackage:
        """Return the description of the file ``urdf``. Raises RobotDescriptionError."""
        ((name, content),) = package_files(urdf).items()
        package = PurePosixPath(name).stem
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            files = {
                each.removeprefix(f"{package}/"): packed.read(each) for each in packed.namelist()
            }
        text = next(files[each] for each in files if each.endswith(".urdf")).decode()
        meshes = {each: data for each, data in files.items() if each.startswith("meshes/")}
        return cls(text, f"package://{package}/", meshes, key)

    def at(self, origin: str) -> str:
        """Return the text whose meshes are at ``origin``, such as http://127.0.0.1:8080."""
        return self.text.replace(self.package, f"{origin}{MESHES}/{self.key}/")
