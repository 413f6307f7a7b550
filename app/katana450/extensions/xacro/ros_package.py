"""Folders of ROS packages, found without ROS."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

NAME = re.compile(r"[A-Za-z][\w-]*")

MANIFEST = "package.xml"

MANIFEST_NAME = re.compile(rb"<name>\s*([\w-]+)\s*</name>")
"""The name of a package in its package.xml."""

WORKSPACES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "CMAKE_PREFIX_PATH")
"""Environment variables that list folders of packages."""

HOME = Path(os.path.expanduser("~")).resolve()
"""The home folder of this user; `Path.home` fails where there is none."""


def package_folder(name: str, folder: Path) -> Path | None:
    """Return the folder of the package ``name``; None if it is not found.

    It is ``folder`` or one above it, if its package.xml has that name; a folder ``name`` beside one
    of these; or where ROS_PACKAGE_PATH and AMENT_PREFIX_PATH lead. A folder beside the home folder
    or one above it, in the home folder, or behind a link needs a package.xml.
    """
    if not NAME.fullmatch(name):
        return None
    for above in (folder, *folder.parents):
        if _manifest_name(above) == name:
            return above
        if _is_package(above / name):
            return above / name
    return next((place for place in _installed(name) if place.is_dir()), None)


def package_of(file: Path) -> Path:
    """Return the innermost folder around ``file`` with a package.xml, or else its own folder."""
    return next((above for above in file.parents if _has_manifest(above)), file.parent)


def workspaces() -> list[Path]:
    """Return the folders with packages that the environment names."""
    return [path for variable in WORKSPACES for path in _paths(variable)]


def real_folders(folder: Path) -> set[Path]:
    """Return the folder behind the link ``folder``, and the one behind its package.xml.

    colcon can install each file of a package as a link to its source.
    """
    source = (folder / MANIFEST).resolve()
    linked = source.name == MANIFEST and source.is_file()
    return {folder.resolve(), *([source.parent] if linked else [])}


def _has_manifest(folder: Path) -> bool:
    # Path.is_file raises an error where a folder is private.
    return os.path.isfile(folder / MANIFEST)


def _is_package(folder: Path) -> bool:
    above = folder.parent.resolve()
    plain = folder.resolve().parent == above and above not in (HOME, *HOME.parents)
    return folder.is_dir() and (plain or _has_manifest(folder))


def _manifest_name(folder: Path) -> str | None:
    with suppress(OSError):
        match = MANIFEST_NAME.search((folder / MANIFEST).read_bytes())
        return match and match[1].decode()
    return None


def _installed(name: str) -> Iterator[Path]:
    for part in _paths("ROS_PACKAGE_PATH"):
        yield part if part.name == name or _manifest_name(part) == name else part / name
    for part in _paths("AMENT_PREFIX_PATH"):
        yield part / "share" / name


def _paths(variable: str) -> list[Path]:
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]
