"""Folders of ROS packages, found without ROS."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

NAME = re.compile(r"[A-Za-z][\w-]*")

MANIFEST_NAME = re.compile(rb"<name>\s*([\w-]+)\s*</name>")
"""The name of a package in its package.xml."""


def package_folder(name: str, folder: Path) -> Path | None:
    """Return the folder of the package ``name``; None if it is not found.

    It is ``folder`` or one above it, if its package.xml has that name; a folder ``name`` beside one
    of these; or where ROS_PACKAGE_PATH and AMENT_PREFIX_PATH lead.
    """
    if not NAME.fullmatch(name):
        return None
    for above in (folder, *folder.parents):
        if _manifest_name(above) == name:
            return above
        if (above / name).is_dir():
            return above / name
    return next((place for place in _installed(name) if place.is_dir()), None)


def _manifest_name(folder: Path) -> str | None:
    with suppress(OSError):
        found = MANIFEST_NAME.search((folder / "package.xml").read_bytes())
        return found and found[1].decode()
    return None


def _installed(name: str) -> Iterator[Path]:
    for part in _paths("ROS_PACKAGE_PATH"):
        yield part if part.name == name or _manifest_name(part) == name else part / name
    for part in _paths("AMENT_PREFIX_PATH"):
        yield part / "share" / name


def _paths(variable: str) -> list[Path]:
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]
