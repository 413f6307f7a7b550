"""Cup, basin and table: the objects of the paper's second experiment, read from their file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import msgspec

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import RobotDescriptionError
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.environment import Basin, Cup, TableTop, WaterEnvironment
from katana450.resources import PROPS_PATH

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
"""A number above 0."""

Point = tuple[float, float, float]

CUP_AT: Point = (0.34, -0.26, 0.0)
BASIN_AT: Point = (0.22, 0.36, 0.0)
"""[m] Places on the table in the base frame: within reach, and clear of the arm's usual paths."""


class Vessel(msgspec.Struct, frozen=True):
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
    mass: Positive
    inner_radius: Positive
    outer_radius: Positive
    height: Positive
    floor: Positive
    floor_radius: Positive = 0.0

    def __post_init__(self) -> None:
        """Complete a vessel with a straight inside. Raises ValueError for one without walls."""
        if not self.floor_radius:
            msgspec.structs.force_setattr(self, "floor_radius", self.inner_radius)
        if not (self.inner_radius < self.outer_radius and self.floor < self.height):
            raise ValueError(f"the walls of {self.mesh.name} have no thickness")

    def scale_to(self, radius: float, height: float) -> tuple[float, float, float]:
        """Return the scale along x, y, z that gives it another outer radius and height [m]."""
        wide = radius / self.outer_radius
        return wide, wide, height / self.height


class TableProp(msgspec.Struct, frozen=True):
    """A board whose upper face is z = 0 of the base frame; x, y: its ends [m]."""

    mesh: Path
    x: tuple[float, float]
    y: tuple[float, float]
    thickness: Positive

    def __post_init__(self) -> None:
        """Raise ValueError for ends in the wrong order."""
        if not (self.x[0] < self.x[1] and self.y[0] < self.y[1]):
            raise ValueError(f"{self.x} or {self.y} is not an interval")


class Props(msgspec.Struct, frozen=True):
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

    def mesh(_kind: type, name: Any) -> Path:
        file = path.parent / str(name)
        if not file.is_file():
            raise ValueError(f"there is no mesh {file}")
        return file

    try:
        return msgspec.json.decode(path.read_bytes(), type=Props, dec_hook=mesh)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise RobotDescriptionError(f"{path} does not describe the props: {error}.") from error


def water_environment(props: Props, basin_at: Point = BASIN_AT) -> WaterEnvironment:
    """Return the water environment of ``props``; ``basin_at``: place in the base frame [m].

    The floor is at the underside of the table.
    """
    cup, basin, table = props.cup, props.basin, props.table
    return WaterEnvironment(
        {
            "cup": Cup(
                Cylinder(cup.inner_radius, _depth(cup)), cup.floor, cup.outer_radius, cup.mass
            )
        },
        Basin(
            basin_at,
            basin.floor,
            basin.floor_radius,
            basin.inner_radius,
            _depth(basin),
            basin.outer_radius,
            basin.mass,
        ),
        TableTop(table.x, table.y, -table.thickness),
    )


def _depth(vessel: Vessel) -> float:
    return vessel.height - vessel.floor
