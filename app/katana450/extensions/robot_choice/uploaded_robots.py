"""Robot descriptions that people have given to the server, each in a folder of its own."""

from __future__ import annotations

import hashlib
import os
import posixpath
import re
import shutil
from pathlib import Path

from katana450.atomic import write_files, writer_of
from katana450.errors import ConfigurationError, InputError
from katana450.extensions.importers.archive import MAX_FILES, ChoiceError, contents, is_inside
from katana450.platform_support import state_folder

DESCRIPTIONS = (".urdf", ".xacro")
"""Suffixes of robot descriptions."""

PARTS = (".stl", ".obj", ".mtl", ".dae", ".ply", ".glb", ".gltf", ".bin", ".yaml", ".yml", ".xml")
"""Suffixes of the files that a description names; pictures are not read."""

MAX_UPLOADED = 20
"""Maximum number of robots that are kept; the one that was not used for longest is removed."""


def uploaded_robots() -> dict[str, Path]:
    """Return the descriptions that are kept by the names of their folders, the last used first."""
    folders = [path for path in _folder().glob("*") if path.is_dir()]
    folders.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    descriptions = {folder.name: folder / "description" for folder in folders}
    return {
        name: link.parent / link.read_text(encoding="utf-8")
        for name, link in descriptions.items()
        if link.is_file()
    }


def used_robot(name: str) -> Path | None:
    """Return the description of the robot ``name``, which counts as used now; None without it."""
    path = uploaded_robots().get(name)
    if path is not None:
        os.utime(_folder() / name)
    return path


def folder_of(path: Path) -> Path | None:
    """Return the folder of the uploaded robot at ``path``; None for the file of another robot."""
    inside = path.is_relative_to(_folder())
    return _folder() / path.relative_to(_folder()).parts[0] if inside else None


def keep_robot(data: bytes, name: str, main: str = "") -> str:
    """Keep the file ``name`` with the content ``data``; return the name of its folder.

    It is a .urdf or .xacro file, or a .zip of one with its meshes; ``main`` is its path there if
    there are several. Raises ChoiceError if one of several must be chosen, InputError for other
    files, and ConfigurationError if it cannot be written.
    """
    files, description = _files(data, name, main)
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", Path(description).name.partition(".")[0])[:24] or "robot"
    key = f"{stem}-{hashlib.sha256(data + description.encode()).hexdigest()[:8]}"
    folder = _folder() / key
    try:
        for path in files:
            (folder / path).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_files({folder / path: writer_of(content) for path, content in files.items()}, 0o600)
        write_files({folder / "description": writer_of(description.encode())}, 0o600)
        os.utime(folder)
        for old in [*uploaded_robots()][MAX_UPLOADED:]:
            shutil.rmtree(_folder() / old, ignore_errors=True)
    except OSError as error:
        raise ConfigurationError(f"{folder} cannot be written: {error.strerror}.") from error
    return key


def _files(data: bytes, name: str, main: str) -> tuple[dict[str, bytes], str]:
    """Return the files of a robot by their paths, and the path of its description."""
    if not name.isprintable():
        raise InputError("The name of the file has characters that cannot be shown.")
    if name.lower().endswith(DESCRIPTIONS):
        own = posixpath.basename(name.replace("\\", "/"))
        return {own: data}, own
    if not name.lower().endswith(".zip"):
        raise InputError(f"{name} is no .urdf, .xacro or .zip file.")

    def path_of(entry: str) -> str | None:
        path = posixpath.normpath(entry.replace("\\", "/"))
        is_part = path.lower().endswith((*DESCRIPTIONS, *PARTS)) and not entry.endswith("/")
        return path if is_part and is_inside(path) and "__MACOSX/" not in path else None

    files, _ = contents(data, name, MAX_FILES, path_of)
    listed = [path for path in files if path.lower().endswith(DESCRIPTIONS)]
    # A file that only defines macros has no links outside of them, and is named by another.
    texts = {path: files[path] for path in listed}
    named = {
        path
        for path in listed
        for other, text in texts.items()
        if other != path and posixpath.basename(path).encode() in text
    }
    free = [path for path in listed if path not in named] or listed
    if main in listed:
        return files, main
    if not free:
        raise InputError(f"There is no .urdf or .xacro file in {name}.")
    if len(free) > 1:
        raise ChoiceError(f"{name} has several robots: choose one.", sorted(free))
    return files, free[0]


def _folder() -> Path:
    return state_folder() / "katana450" / "robots"
