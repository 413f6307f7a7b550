"""Files that belong to the package: the robot description and the page.

In a checkout they are folders beside `app`. An installed package contains copies of them.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def folder(name: str) -> Path:
    """Return the folder ``name`` of the installed package, or else of the checkout."""
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parents[1] / name


STATIC: Path = folder("static")
"""Scripts, styles and pages for the browser."""

URDF_PATH: Path = folder("robot_description") / "katana450.urdf"
"""URDF of the Katana450 with all numbers of the arm. Its meshes are beside it."""

PROPS_PATH: Path = URDF_PATH.parent / "props" / "props.json"
"""Sizes and masses of the table, the cup and the basin."""
