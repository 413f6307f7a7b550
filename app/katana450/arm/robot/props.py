"""Cup, basin and table: the objects of the paper's second experiment, read from their file."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.errors import RobotDescriptionError
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.environment import Basin, Cup, TableTop, WaterEnvironment
from katana450.resources import PROPS_PATH

Point = tuple[float, float, float]

CUP_AT: Point = (0.34, -0.26, 0.0)
BASIN_AT: Point = (0.22, 0.36, 0.0)
"""[m] Places on the table in the base frame: within reach, and clear of the arm's usual paths."""


@dataclass(frozen=True)
class Vessel:
    """A vessel for water about its own axis z, standing on z = 0.

    Attributes:
        mesh: its GLB file.
        mass: [kg].
        inner_radius: at the rim [m].
        outer_radius: of its widest part [m].
        height: [m].
        floor: thickness of the floor [m].
        floor_radius: of the inside above the floor [m].
    """

    mesh: Path
    mass: float
    inner_radius: float
    outer_radius: float
    height: float
    floor: float
    floor_radius: float

    def scale_to(self, radius: float, height: float) -> tuple[float, float, float]:
        """Return the scale along x, y, z that gives it another outer radius and height [m]."""
        wide = radius / self.outer_radius
        return wide, wide, height / self.height


@dataclass(frozen=True)
class TableProp:
    """A board whose upper face is z = 0 of the base frame; x, y: its ends [m]."""

    mesh: Path
    x: tuple[float, float]
    y: tuple[float, float]
    thickness: float


@dataclass(frozen=True)
class Props:
    """Cup, basin and table."""

    cup: Vessel
    basin: Vessel
    table: TableProp

    def file_of(self, scene_object: SceneObject) -> tuple[Path, tuple[float, float, float]] | None:
        """Return the GLB file of a cup, basin or vessel and its scale; None for other objects."""
        if scene_object.shape is Shape.VESSEL:
            return self.cup.mesh, self.cup.scale_to(*scene_object.extent)
        prop = {"cup": self.cup, "basin": self.basin}.get(scene_object.name)
        return None if prop is None else (prop.mesh, (scene_object.scale,) * 3)


def load_props(path: Path = PROPS_PATH) -> Props:
    """Read the props. Raises RobotDescriptionError if the file is missing or invalid."""
    try:
        described = json.loads(path.read_text(encoding="utf-8"))
        table = described["table"]
        return Props(
            cup=_vessel(path, described["cup"]),
            basin=_vessel(path, described["basin"]),
            table=TableProp(
                _mesh(path, table),
                _span(table["x"]),
                _span(table["y"]),
                _length(table, "thickness"),
            ),
        )
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise RobotDescriptionError(f"{path} does not describe the props: {error!r}.") from error


def _vessel(path: Path, described: Any) -> Vessel:
    # A vessel without this entry has a straight inside.
    floor_radius = "floor_radius" if "floor_radius" in described else "inner_radius"
    lengths = ("mass", "inner_radius", "outer_radius", "height", "floor", floor_radius)
    vessel = Vessel(_mesh(path, described), *(_length(described, key) for key in lengths))
    if not (vessel.inner_radius < vessel.outer_radius and vessel.floor < vessel.height):
        raise ValueError(f"the walls of {vessel.mesh.name} have no thickness")
    return vessel


def _mesh(path: Path, described: Any) -> Path:
    mesh = path.parent / str(described["mesh"])
    if not mesh.is_file():
        raise ValueError(f"there is no mesh {mesh}")
    return mesh


def _length(described: Any, key: str) -> float:
    value = float(described[key])
    if not 0.0 < value < math.inf:
        raise ValueError(f"{key!r} is {value}")
    return value


def _span(ends: Any) -> tuple[float, float]:
    low, high = (float(end) for end in ends)
    if not -math.inf < low < high < math.inf:
        raise ValueError(f"{ends} is not an interval")
    return low, high


def water_environment(props: Props, basin_at: Point = BASIN_AT) -> WaterEnvironment:
    """Return the water environment of ``props``; ``basin_at``: place in the base frame [m].

    The floor is at the underside of the table.
    """
    cup, basin, table = props.cup, props.basin, props.table
    return WaterEnvironment(
        {"cup": Cup(Cylinder(cup.inner_radius, _depth(cup)), cup.floor, cup.outer_radius)},
        Basin(
            basin_at,
            basin.floor,
            basin.floor_radius,
            basin.inner_radius,
            _depth(basin),
            basin.outer_radius,
        ),
        TableTop(table.x, table.y, -table.thickness),
    )


def _depth(vessel: Vessel) -> float:
    return vessel.height - vessel.floor
