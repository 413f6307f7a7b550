"""A robot description that was made from another file, in a folder of this user."""

from __future__ import annotations

import hashlib
from pathlib import Path
from xml.etree.ElementTree import Element, tostring

from katana450.arm.robot.visual import mesh_file
from katana450.atomic import write_files, writer_of
from katana450.errors import ConfigurationError
from katana450.platform_support import cache_folder


def derived_urdf(root: Element, path: Path, kind: str) -> Path:
    """Return a file with the robot ``root``, which was made from the file at ``path``.

    Its meshes get absolute names, because it lies in another folder. ``kind``: name of the folder
    of such files. Raises ConfigurationError if it cannot be written.
    """
    for mesh in root.iter("mesh"):
        mesh.set("filename", f"file://{mesh_file(mesh.attrib['filename'], path.parent)}")
    content = tostring(root)
    digest = hashlib.sha256(content).hexdigest()[:12]
    file = cache_folder() / f"katana450-{kind}" / f"{path.stem}-{digest}.urdf"
    if not file.is_file():
        try:
            file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigurationError(f"{file} cannot be written: {error.strerror}.") from error
        write_files({file: writer_of(content)}, 0o600)
    return file
