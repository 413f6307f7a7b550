"""Files that belong to the package: the robot description and the page.

In a checkout they are folders beside `app`. An installed package contains copies of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def folder(name: str) -> Path:
    """Return the folder ``name`` of the installed package, or else of the checkout."""
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parents[1] / name


STATIC: Path = folder("static")
"""Scripts, styles and pages for the browser."""

_ROBOTS = folder("robot_description")

URDF_PATH: Path = _ROBOTS / "katana450.urdf"
"""URDF of the Katana450 with all numbers of the arm. Its meshes are beside it."""

INCLUDED: Mapping[str, Path] = {
    "katana450": URDF_PATH,
    "so101": _ROBOTS / "so101" / "so101.urdf",
}
"""URDF of each robot of this distribution by its name."""


def robot_file(robot: str | Path | None) -> Path:
    """Return the file of an included ``robot``, or ``robot`` itself; None is the Katana450."""
    return URDF_PATH if robot is None else INCLUDED.get(str(robot), Path(robot))


PROPS_PATH: Path = URDF_PATH.parent / "props" / "props.json"
"""Sizes and masses of the table, the cup and the basin."""
