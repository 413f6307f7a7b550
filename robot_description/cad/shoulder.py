"""pan_link: the shoulder fork that turns on the column; mm."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from robot_description.cad import conduit
from robot_description.cad.fittings import bored, eye, hub, screws
from robot_description.cad.fork import BELLOWS_RADIUS
from robot_description.cad.material import ALUMINIUM, RUBBER, STEEL
from robot_description.cad.outline import circle, hull, octagon, on_grid, rectangle
from robot_description.cad.part import Part
from robot_description.cad.solid import Range, block, prism, rod

# Heights from the axis of the shoulder, 201.5 above the base's underside.
AXIS_HEIGHT = 201.5
NECK_DIAMETER, NECK_FOOT = 64.0, 133.0 - AXIS_HEIGHT
SKIRT_FOOT, SKIRT_TOP = 139.5 - AXIS_HEIGHT, 157.0 - AXIS_HEIGHT
RING_FOOT, RING_TOP = SKIRT_FOOT - 1.0, SKIRT_FOOT + 0.5
SKIRT_FOOT_DIAMETER, SKIRT_RIM = 80.0, 3.0
CHEEK_RADIUS, CHEEK_INSIDE, CHEEK_OUTSIDE = 46.0, 22.5, 47.5
CHEEK_EDGE_OUTSIDE, CHEEK_EDGE_INSIDE = 6.0, 1.4
SHAFT_DIAMETER, SHAFT_HALF_LENGTH = 42.0, 46.5
BOSS_ACROSS, BOSS_END = 66.0, 53.0
DISC_START, DISC_DIAMETER, DISC_END = 53.0, 60.0, 66.0
CAP_DIAMETER, CAP_END = 28.0, 67.0
# The aprons close the slot below the bellows: x at the foot and at the top, z of the top.
FRONT_APRON, BACK_APRON = (48.2, 44.6, -29.5), (-46.6, -45.4, 4.0)
APRON_HALF, APRON_CLEARANCE, APRON_PLEAT, APRON_DEPTH = 22.0, 0.7, 3.4, 1.5


def _apron(foot: float, top: float, height: float) -> Manifold:
    """Return a pleated wall across the slot, with space for the bellows that turn inside."""
    count = round((height - SKIRT_TOP) / APRON_PLEAT)
    outward = 1.0 if foot > 0.0 else -1.0
    corners = [(outward * 12.0, SKIRT_TOP - 1.0), (foot, SKIRT_TOP - 1.0)]
    for k in range(count):
        for fraction, depth in ((0.15, 0.0), (0.45, 0.0), (0.8, APRON_DEPTH)):
            along = (k + fraction) / count
            x = foot + along * (top - foot) - outward * depth
            corners.append((x, SKIRT_TOP + along * (height - SKIRT_TOP)))
    corners += [(top, height), (outward * 12.0, height)]
    outline = on_grid(np.array(corners if outward > 0.0 else corners[::-1]))
    wall = prism(outline, -APRON_HALF, APRON_HALF, 0.0, "y")
    hollow = BELLOWS_RADIUS + APRON_CLEARANCE
    return wall - rod(2 * hollow, -APRON_HALF - 1.0, APRON_HALF + 1.0, "+y")


def _boss(toward: float) -> Manifold:
    y: Range = (CHEEK_OUTSIDE - 1.0, BOSS_END) if toward > 0 else (-BOSS_END, 1.0 - CHEEK_OUTSIDE)
    return prism(octagon(BOSS_ACROSS, 3.0), *y, (0.0, 2.0) if toward > 0 else (2.0, 0.0), "y")


def pan_link() -> Part:
    """Return the shoulder fork in its frame, whose origin is the crossing of axes 1 and 2."""
    part = Part("pan_link")
    side = CHEEK_RADIUS
    foot = prism(rectangle((-side, side), (-CHEEK_OUTSIDE, CHEEK_OUTSIDE), 9.0), -1.0, 0.0)
    skirt = rod(SKIRT_FOOT_DIAMETER, SKIRT_FOOT, SKIRT_FOOT + SKIRT_RIM)
    skirt = Manifold.batch_hull([skirt, foot.translate((0.0, 0.0, SKIRT_TOP))])
    neck = rod(NECK_DIAMETER, NECK_FOOT, SKIRT_TOP - 1.0)
    cheek = hull(circle(side), rectangle((-side, side), (SKIRT_TOP - 6.0, 0.0), 6.5))
    inner, outer = CHEEK_EDGE_INSIDE, CHEEK_EDGE_OUTSIDE
    part.add(
        ALUMINIUM,
        neck,
        skirt,
        prism(cheek, CHEEK_INSIDE, CHEEK_OUTSIDE, (inner, outer), "y"),
        prism(cheek, -CHEEK_OUTSIDE, -CHEEK_INSIDE, (outer, inner), "y"),
        _boss(1.0),
        _boss(-1.0),
    )
    part.add(RUBBER, _apron(*FRONT_APRON), _apron(*BACK_APRON))
    bored(part, SHAFT_DIAMETER, SHAFT_HALF_LENGTH)
    hub(part, (DISC_START, DISC_END), DISC_DIAMETER, CAP_DIAMETER, CAP_END, star=True)
    screws(part, [(x, CHEEK_OUTSIDE, -37.0) for x in (-36.0, 36.0)], "+y", 5.0)
    screws(part, [(x, -CHEEK_OUTSIDE, -37.0) for x in (-36.0, 36.0)], "-y", 5.0)
    part.add(STEEL, rod(NECK_DIAMETER + 6.0, RING_FOOT, RING_TOP))
    x, y, z = conduit.SHOULDER.at
    bracket = block((x - 5.0, x + 5.0), (CHEEK_OUTSIDE - 8.0, y - 9.0), (z - 5.0, z + 5.0), 1.2)
    plate = block(
        (x - 11.0, x + 11.0), (CHEEK_OUTSIDE - 2.0, CHEEK_OUTSIDE + 2.6), (z - 5.0, z + 5.0), 1.2
    )
    eye(part, conduit.SHOULDER, bracket + plate)
    screws(part, [(x + u, CHEEK_OUTSIDE + 2.6, z) for u in (-8.0, 8.0)], "+y", 3.4)
    return part
