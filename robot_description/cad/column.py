"""arm_base_link and pan_link: the round column and the shoulder fork that turns on it; mm."""

from __future__ import annotations

import math

from manifold3d import Manifold

from robot_description.cad.fittings import bored, gland, hub, screws
from robot_description.cad.material import ALUMINIUM, BRIGHT, PLASTIC, STEEL
from robot_description.cad.outline import circle, hull, octagon, rectangle
from robot_description.cad.part import Part
from robot_description.cad.solid import around, block, lathe, prism, rod

# arm_base_link: heights above the base's underside.
FLANGE_DIAMETER, FLANGE_HEIGHT = 110.0, 12.0
FLANGE_SCREWS, FLANGE_SCREW_CIRCLE = 12, 51.0
RING_DIAMETER, RING_TOP = 94.0, 42.0
STEP_DIAMETER, STEP_TOP = 84.0, 52.5
COLUMN_DIAMETER, COLUMN_FOOT, COLUMN_TOP = 77.0, 55.0, 114.0
COLLAR_DIAMETER, COLLAR_FOOT, COLLAR_TOP = 82.0, 116.0, 138.0
BORE_DIAMETER, BORE_FLOOR = 65.0, 124.0
CABLE_BOX_X, CABLE_BOX_Y, CABLE_BOX_Z = (-33.5, 33.5), (20.0, 57.0), (19.0, 42.0)
CONNECTOR_X, CONNECTOR_Y, CONNECTOR_Z = (-57.0, -40.0), (-14.0, 14.0), (20.0, 38.0)

# pan_link: heights from the axis of the shoulder, 201.5 above the base's underside.
AXIS_HEIGHT = 201.5
NECK_DIAMETER, NECK_FOOT = 64.0, 133.0 - AXIS_HEIGHT
SKIRT_FOOT, SKIRT_TOP = 139.0 - AXIS_HEIGHT, 157.0 - AXIS_HEIGHT
SKIRT_FOOT_DIAMETER = 80.0
CHEEK_RADIUS, CHEEK_INSIDE, CHEEK_OUTSIDE = 46.0, 22.5, 47.5
CHEEK_EDGE_OUTSIDE, CHEEK_EDGE_INSIDE = 5.0, 1.2
SHAFT_DIAMETER, SHAFT_HALF_LENGTH = 42.0, 46.5
BOSS_ACROSS, BOSS_END = 54.0, 55.5
DISC_DIAMETER, DISC_END = 60.0, 66.0
CAP_DIAMETER, CAP_END = 28.0, 67.5


def _column() -> Manifold:
    return lathe(
        [
            (0.0, FLANGE_DIAMETER / 2, 0.0),
            (FLANGE_HEIGHT, FLANGE_DIAMETER / 2, 1.5),
            (FLANGE_HEIGHT, RING_DIAMETER / 2, 0.0),
            (RING_TOP, RING_DIAMETER / 2, 1.5),
            (RING_TOP, STEP_DIAMETER / 2, 0.0),
            (STEP_TOP - 1.0, STEP_DIAMETER / 2, 1.0),
            (COLUMN_FOOT, COLUMN_DIAMETER / 2 + 0.8, 0.0),
            (COLUMN_FOOT, COLUMN_DIAMETER / 2 - 0.8, 0.0),
            (COLUMN_FOOT + 1.4, COLUMN_DIAMETER / 2 - 0.8, 0.0),
            (COLUMN_FOOT + 1.4, COLUMN_DIAMETER / 2, 0.0),
            (COLUMN_TOP - 8.0, COLUMN_DIAMETER / 2, 0.0),
            (COLUMN_TOP - 8.0, COLUMN_DIAMETER / 2 - 0.8, 0.0),
            (COLUMN_TOP - 6.6, COLUMN_DIAMETER / 2 - 0.8, 0.0),
            (COLUMN_TOP - 6.6, COLUMN_DIAMETER / 2, 0.0),
            (COLUMN_TOP, COLUMN_DIAMETER / 2, 0.0),
            (COLLAR_FOOT, COLLAR_DIAMETER / 2, 0.0),
            (COLLAR_TOP, COLLAR_DIAMETER / 2, 1.5),
            (COLLAR_TOP, BORE_DIAMETER / 2 + 3.0, 0.0),
        ]
    )


def arm_base_link() -> Part:
    """Return the column in its frame: z 0 on the underside of the base."""
    part = Part("arm_base_link")
    part.add(
        ALUMINIUM,
        _column(),
        block(CABLE_BOX_X, CABLE_BOX_Y, CABLE_BOX_Z, 1.5),
        block(CONNECTOR_X, CONNECTOR_Y, CONNECTOR_Z, 1.0),
    )
    part.cut(rod(BORE_DIAMETER, BORE_FLOOR, 150.0))
    face = CABLE_BOX_Y[1]
    middle = sum(CABLE_BOX_Z) / 2
    part.add(
        BRIGHT,
        block((-27.0, 27.0), (face - 1.0, face + 1.2), (CABLE_BOX_Z[0] + 2.5, 39.5), 0.5),
    )
    gland(part, (14.0, face + 1.2, middle), "+y", 3)
    plate = [(x, face + 1.2, z) for x in (-23.5, 23.5) for z in (25.0, 36.0)]
    screws(part, plate, "+y", 3.6)
    part.add(PLASTIC, block((-57.8, -50.0), (-10.0, 10.0), (23.5, 34.5), 0.5))
    phase = math.pi / FLANGE_SCREWS
    flange = around(FLANGE_SCREWS, FLANGE_SCREW_CIRCLE, phase)
    screws(part, [(x, y, FLANGE_HEIGHT) for x, y in flange], "+z", 4.4)
    return part


def pan_link() -> Part:
    """Return the shoulder fork in its frame: the origin where axes 1 and 2 cross."""
    part = Part("pan_link")
    side = CHEEK_RADIUS
    foot = prism(rectangle((-side, side), (-CHEEK_OUTSIDE, CHEEK_OUTSIDE), 8.0), -1.0, 0.0)
    skirt = rod(SKIRT_FOOT_DIAMETER, SKIRT_FOOT, SKIRT_FOOT + 1.5)
    skirt = Manifold.batch_hull([skirt, foot.translate((0.0, 0.0, SKIRT_TOP))])
    neck = rod(NECK_DIAMETER, NECK_FOOT, SKIRT_TOP - 1.0)
    cheek = hull(circle(side), rectangle((-side, side), (SKIRT_TOP - 6.0, 0.0), 5.5))
    inner, outer = CHEEK_EDGE_INSIDE, CHEEK_EDGE_OUTSIDE
    part.add(
        ALUMINIUM,
        neck,
        skirt,
        prism(cheek, CHEEK_INSIDE, CHEEK_OUTSIDE, (inner, outer), "y"),
        prism(cheek, -CHEEK_OUTSIDE, -CHEEK_INSIDE, (outer, inner), "y"),
        prism(octagon(BOSS_ACROSS, 2.0), -BOSS_END, BOSS_END, 1.0, "y")
        - block((-60.0, 60.0), (-CHEEK_INSIDE - 3, CHEEK_INSIDE + 3), (-60.0, 60.0)),
    )
    bored(part, SHAFT_DIAMETER, SHAFT_HALF_LENGTH)
    hub(part, (BOSS_END, DISC_END), DISC_DIAMETER, CAP_DIAMETER, CAP_END)
    screws(part, [(x, CHEEK_OUTSIDE, -36.0) for x in (-34.0, 34.0)], "+y", 5.0)
    screws(part, [(x, -CHEEK_OUTSIDE, -36.0) for x in (-34.0, 34.0)], "-y", 5.0)
    part.add(STEEL, rod(NECK_DIAMETER + 4.0, SKIRT_FOOT - 0.4, SKIRT_FOOT + 0.5))
    return part
