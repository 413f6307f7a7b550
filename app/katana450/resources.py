"""Files that belong to the package: the robot's description and the page.

In a checkout they are folders beside `app`; an installed package holds copies of them.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def folder(name: str) -> Path:
    """Return the folder ``name`` of the installed package, or else the one of the checkout."""
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parents[1] / name


STATIC: Path = folder("static")
"""Scripts, styles and pages that a browser loads."""

URDF_PATH: Path = folder("robot_description") / "katana450.urdf"
"""The URDF of the Katana450: every number of the arm. Its meshes lie beside it."""

PROPS_PATH: Path = URDF_PATH.parent / "props" / "props.json"
"""Sizes and masses of the table, the cup and the basin."""
