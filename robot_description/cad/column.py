"""arm_base_link: the round column on which the arm turns; mm."""

from __future__ import annotations

import math

from manifold3d import Manifold

from robot_description.cad import conduit
from robot_description.cad.fittings import gland, name_round, plug, screws, seam
from robot_description.cad.material import ALUMINIUM, BLUE, BRIGHT, STEEL
from robot_description.cad.part import Part
from robot_description.cad.solid import around, block, lathe, rod

# Heights above the base's underside.
FLANGE_DIAMETER, FLANGE_HEIGHT = 110.0, 12.0
FLANGE_SCREWS, FLANGE_SCREW_CIRCLE = 6, 51.0
RING_DIAMETER, RING_TOP = 94.0, 42.0
STEP_DIAMETER, STEP_TOP = 84.0, 52.5
COLUMN_DIAMETER, COLUMN_FOOT, COLUMN_TOP = 77.0, 55.0, 114.0
COLLAR_DIAMETER, COLLAR_FOOT, COLLAR_TOP = 82.0, 116.0, 138.0
BORE_DIAMETER, BORE_FLOOR = 65.0, 124.0
CABLE_BOX_X, CABLE_BOX_Y, CABLE_BOX_Z = (-33.5, 33.5), (20.0, 57.0), (19.0, 42.0)
PLATE_X, PLATE_Z, PLATE_STANDS = (-30.5, 30.5), (20.5, 40.5), 1.2
CONNECTOR_X, CONNECTOR_Y, CONNECTOR_Z = (-55.0, -40.0), (-17.0, 17.0), (20.0, 39.0)
PLUG_DIAMETER = 12.0
NAME_HEIGHT, NAME_AT, NAME_AZIMUTH = 9.5, 84.0, -48.0


def _column() -> Manifold:
    radius, collar = COLUMN_DIAMETER / 2, COLLAR_DIAMETER / 2
    return lathe(
        [
            (0.0, FLANGE_DIAMETER / 2, 0.0),
            (FLANGE_HEIGHT, FLANGE_DIAMETER / 2, 1.5),
            (FLANGE_HEIGHT, RING_DIAMETER / 2, 0.0),
            (RING_TOP, RING_DIAMETER / 2, 2.0),
            (RING_TOP, STEP_DIAMETER / 2, 0.0),
            (STEP_TOP, STEP_DIAMETER / 2, 1.2),
            (STEP_TOP, radius - 1.2, 0.0),
            (COLUMN_FOOT, radius - 1.2, 0.0),
            (COLUMN_FOOT, radius, 0.0),
            (COLUMN_TOP, radius, 0.0),
            (COLLAR_FOOT, collar, 0.0),
            (COLLAR_TOP, collar, 2.0),
            (COLLAR_TOP, BORE_DIAMETER / 2 + 3.0, 0.0),
        ]
    )


def arm_base_link() -> Part:
    """Return the column in its frame: z 0 on the underside of the base."""
    part = Part("arm_base_link")
    part.add(
        ALUMINIUM,
        _column(),
        block(CABLE_BOX_X, CABLE_BOX_Y, CABLE_BOX_Z, 2.0),
        block(CONNECTOR_X, CONNECTOR_Y, CONNECTOR_Z, 1.5),
    )
    part.add(
        STEEL,
        seam(COLUMN_DIAMETER / 2, COLUMN_TOP - 9.0, FLANGE_DIAMETER / 2),
        seam(COLLAR_DIAMETER / 2, COLLAR_FOOT + 7.0, FLANGE_DIAMETER / 2),
    )
    part.cut(rod(BORE_DIAMETER, BORE_FLOOR, 150.0))
    face = CABLE_BOX_Y[1] + PLATE_STANDS
    part.add(BRIGHT, block(PLATE_X, (CABLE_BOX_Y[1] - 1.0, face), PLATE_Z, 0.6))
    gland(part, conduit.BASE)
    screws(part, [(x, face, z) for x in (-27.5, 27.5) for z in (24.0, 37.0)], "+y", 3.6)
    plug(part, (-16.0, face, 30.5), "+y", PLUG_DIAMETER)
    for y in (-8.5, 8.5):
        plug(part, (CONNECTOR_X[0], y, sum(CONNECTOR_Z) / 2), "-x", PLUG_DIAMETER)
    phase = math.pi / FLANGE_SCREWS
    flange = around(FLANGE_SCREWS, FLANGE_SCREW_CIRCLE, phase)
    screws(part, [(x, y, FLANGE_HEIGHT) for x, y in flange], "+z", 4.4)
    text = name_round("katana450", NAME_HEIGHT, COLUMN_DIAMETER / 2, NAME_AZIMUTH)
    part.add(BLUE, text.translate((0.0, 0.0, NAME_AT)))
    return part
