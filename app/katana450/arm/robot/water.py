"""The props as vessels that hold and catch water."""

from __future__ import annotations

from katana450.arm.robot.props import BASIN_AT, Point, Props, Vessel
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.environment import Basin, Cup, TableTop, WaterEnvironment


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
