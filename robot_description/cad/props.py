"""The props of the arm: a cup, a basin and the table top on which it stands; mm.

Cup and basin stand on z = 0 about their own axis. The table is in the frame of base_link.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from robot_description.cad.build import MILLIMETRE, Built, write_glb
from robot_description.cad.fingers import pocket
from robot_description.cad.mass import moments_of
from robot_description.cad.material import BIRCH, LAMINATE, MELAMINE, RIM
from robot_description.cad.outline import rectangle
from robot_description.cad.part import Part
from robot_description.cad.solid import lathe, prism, rod

PROPS = Path(__file__).resolve().parent.parent / "props"
DATA = "props.json"

CUP_INNER_RADIUS, CUP_OUTER_RADIUS = 30.0, 32.0
CUP_HEIGHT, CUP_FLOOR = 90.0, 3.0
CUP_RIM = 3.5  # height of the coloured rim
CUP_FOOT = 3.0  # fillet under the wall
CUP_SEGMENTS = 56

BASIN_INNER_RADIUS, BASIN_FLOOR_RADIUS, BASIN_OUTER_RADIUS = 115.0, 84.0, 126.0
BASIN_HEIGHT, BASIN_FLOOR, BASIN_WALL = 70.0, 4.5, 2.6
BASIN_FILLET, BASIN_BEAD = 16.0, 2.4
BASIN_SEGMENTS = 64

TABLE_X, TABLE_Y, TABLE_THICK = (-250.0, 750.0), (-700.0, 700.0), 25.0
TABLE_CORNER, TABLE_SHEET, TABLE_EDGE = 30.0, 3.0, 2.0

_RECESS = 1.2  # of the underside within its foot ring
_LIP = [math.radians(a) for a in (-90.0, -45.0, 0.0, 45.0, 90.0)]


def cup() -> Part:
    """Return a straight cup."""
    part = Part("cup")
    inner, outer = CUP_INNER_RADIUS, CUP_OUTER_RADIUS
    half, middle = (outer - inner) / 2, (outer + inner) / 2
    split = CUP_HEIGHT - CUP_RIM
    body = lathe(
        [
            (_RECESS, inner - 7.0, 0.0),
            (0.0, inner - 6.0, 0.4),
            (0.0, outer, CUP_FOOT),
            (split, outer, 0.0),
            (split, inner, 0.0),
            (CUP_FLOOR, inner, 1.0),
        ],
        segments=CUP_SEGMENTS,
    )
    lip = [(CUP_HEIGHT - half + half * math.cos(a), middle - half * math.sin(a), 0.0) for a in _LIP]
    rim = lathe([(split, outer, 0.0), *lip], segments=CUP_SEGMENTS)
    part.add(MELAMINE, body)
    part.add(RIM, rim - rod(2 * inner, 0.0, 2 * CUP_HEIGHT, segments=CUP_SEGMENTS))
    return part


def basin() -> Part:
    """Return a round basin with a flared wall and a beaded rim."""
    part = Part("basin")
    bead = BASIN_BEAD
    lip = BASIN_HEIGHT - bead  # the rim's middle
    low, high = lip - BASIN_WALL / 2, lip + BASIN_WALL / 2
    edge = BASIN_OUTER_RADIUS - bead
    foot = BASIN_FLOOR_RADIUS - 2.0
    body = lathe(
        [
            (_RECESS, foot - 6.0, 0.0),
            (0.0, foot - 5.0, 0.5),
            (0.0, foot, 1.0),
            (BASIN_FLOOR - BASIN_WALL, BASIN_FLOOR_RADIUS - 1.0, 0.0),
            (BASIN_FLOOR, BASIN_FLOOR_RADIUS + BASIN_WALL + 2.0, 3.0),
            (low, BASIN_INNER_RADIUS + BASIN_WALL, 1.2),
            (low, edge, 0.0),
            (high, edge, 0.0),
            (high, BASIN_INNER_RADIUS, 3.5),
            (BASIN_FLOOR, BASIN_FLOOR_RADIUS, BASIN_FILLET),
        ],
        segments=BASIN_SEGMENTS,
    )
    ring = [
        (lip + bead * math.sin(a), edge + bead * math.cos(a), 0.0)
        for a in [math.radians(k * 45.0) for k in range(-2, 3)]
    ]
    band = lathe(ring, segments=BASIN_SEGMENTS)
    hole = [
        (lip - 20.0, edge, 0.0),
        (lip - bead, edge, 0.0),
        (lip, edge - bead, 0.0),
        (lip + bead, edge, 0.0),
        (lip + 20.0, edge, 0.0),
    ]
    part.add(MELAMINE, body)
    part.add(RIM, band - lathe(hole, segments=BASIN_SEGMENTS))
    return part


def table() -> Part:
    """Return the table top: laminate on birch plywood, its upper face at z 0."""
    part = Part("table")
    outline = rectangle(TABLE_X, TABLE_Y, TABLE_CORNER)
    part.add(LAMINATE, prism(outline, -TABLE_SHEET, 0.0, (0.0, TABLE_EDGE)))
    part.add(BIRCH, prism(outline, -TABLE_THICK, -TABLE_SHEET, (TABLE_EDGE, 0.0)))
    return part


PARTS: tuple[Callable[[], Part], ...] = (cup, basin, table)


def _metres(*lengths: float) -> Any:
    rounded = [round(length * MILLIMETRE, 6) for length in lengths]
    return rounded[0] if len(rounded) == 1 else rounded


def dimensions() -> dict[str, Any]:
    """Return the contents of the data file of the props, in metres and kilograms."""
    angle, distance = pocket(CUP_OUTER_RADIUS)
    return {
        "about": "Metres, kilograms, radians. Cup and basin stand on z = 0 about their own axis z; "
        "the table is in the frame of base_link, its upper face at z = 0. Upright between the "
        "fingers the cup is held at one finger angle, its axis before the fingers' pivot.",
        "cup": {
            "mesh": "cup.glb",
            "mass": round(moments_of(cup()).mass, 4),
            "inner_radius": _metres(CUP_INNER_RADIUS),
            "outer_radius": _metres(CUP_OUTER_RADIUS),
            "height": _metres(CUP_HEIGHT),
            "floor": _metres(CUP_FLOOR),
            "held_at_finger_angle": round(angle, 4),
            "held_before_pivot": _metres(round(distance, 2)),
        },
        "basin": {
            "mesh": "basin.glb",
            "mass": round(moments_of(basin()).mass, 4),
            "inner_radius": _metres(BASIN_INNER_RADIUS),
            "floor_radius": _metres(BASIN_FLOOR_RADIUS),
            "outer_radius": _metres(BASIN_OUTER_RADIUS),
            "height": _metres(BASIN_HEIGHT),
            "floor": _metres(BASIN_FLOOR),
        },
        "table": {
            "mesh": "table.glb",
            "x": _metres(*TABLE_X),
            "y": _metres(*TABLE_Y),
            "thickness": _metres(TABLE_THICK),
            "corner_radius": _metres(TABLE_CORNER),
        },
    }


def build_props(folder: Path = PROPS) -> Iterator[Built]:
    """Write the GLB file of every prop and the data file into ``folder``; yield each GLB file."""
    folder.mkdir(parents=True, exist_ok=True)
    for make in PARTS:
        yield write_glb(make(), folder)
    (folder / DATA).write_text(json.dumps(dimensions(), indent=2) + "\n", "utf-8")
