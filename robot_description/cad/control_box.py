"""base_link: the control box, standing on the table, connector panel towards -y; mm."""

from __future__ import annotations

import math

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from robot_description.cad.fittings import screws
from robot_description.cad.material import ALUMINIUM, GREY, PANEL
from robot_description.cad.outline import Outline, circle, facets_of, hull, inset, rectangle
from robot_description.cad.panel import connectors
from robot_description.cad.part import Part
from robot_description.cad.solid import around, block, lathe, loft, prism, rod

FLANGE_DIAMETER, FLANGE_HEIGHT, FLANGE_EDGE = 242.0, 11.0, 1.6
BOLTS, BOLT_CIRCLE, COUNTERBORE, BOLT_DEPTH, BOLT_HEAD = 6, 113.0, 11.0, 6.0, 8.5
DRUM_DIAMETER, DRUM_EDGE, DRUM_GAP = 195.0, 5.0, 1.2
TOP_CENTRE = 73.0  # where the arm's base stands
TOP_RISE, TOP_SAG = 10.0, 6.0  # of the saddle at the rim, towards y and towards x
TOP_RINGS = (0.9, 0.8, 0.7, 0.6, 0.5)  # fractions of the rim; the rings bend with the saddle
SEAT_DIAMETER = 112.0
PANEL_Y, LIP_Y, LIP_CORNER = -72.0, -77.0, 9.0
LIP_UNDERSIDE = 70.0
PANEL_HALF_WIDTH, PANEL_Z, PANEL_CORNER = 58.0, (15.0, 67.5), 5.0
PANEL_STANDS = 1.4


def _plan() -> Outline:
    """Return the outline of the drum from above: a circle cut by the lip over the panel.

    Its corners are rounded.
    """
    rim = DRUM_DIAMETER / 2
    y = LIP_Y + LIP_CORNER
    x = math.sqrt((rim - LIP_CORNER) ** 2 - y * y)
    round_part = circle(rim)
    kept = round_part[round_part[:, 1] > rim * y / (rim - LIP_CORNER)]
    return hull(kept, circle(LIP_CORNER, (x, y)), circle(LIP_CORNER, (-x, y)))


def _saddle(points: NDArray[np.float64]) -> NDArray[np.float64]:
    bent = np.array(points)
    rim = DRUM_DIAMETER / 2
    lift = TOP_RISE * (bent[:, 1] / rim) ** 2 - TOP_SAG * (bent[:, 0] / rim) ** 2
    bent[:, 2] += np.where(bent[:, 2] > TOP_CENTRE / 2, lift, 0.0)
    return bent


def _drum() -> Manifold:
    plan = _plan()
    foot = FLANGE_HEIGHT + DRUM_GAP
    levels = [(FLANGE_HEIGHT - 2.0, 1.6), (foot, 1.6), (foot, 0.0)]
    facets = facets_of(DRUM_EDGE)
    for k in range(facets + 1):
        turn = math.pi / 2.0 * k / facets
        across, down = DRUM_EDGE * (1.0 - math.cos(turn)), DRUM_EDGE * (1.0 - math.sin(turn))
        levels.append((TOP_CENTRE - down, across))
    rings = [
        np.column_stack((inset(plan, across) if across > 1e-9 else plan, np.full(len(plan), z)))
        for z, across in levels
    ]
    top = inset(plan, DRUM_EDGE)
    rings += [
        np.column_stack((top * fraction, np.full(len(top), TOP_CENTRE))) for fraction in TOP_RINGS
    ]
    return loft(rings).warp_batch(_saddle)


def base_link() -> Part:
    """Return the control box in its frame: z 0 on the table."""
    part = Part("base_link")
    rim = FLANGE_DIAMETER / 2
    recess = block((-99.0, 99.0), (-99.0, PANEL_Y), (0.0, LIP_UNDERSIDE))
    part.add(ALUMINIUM, _drum() - recess)
    part.add(
        GREY, lathe([(0.0, rim - 0.8, 0.0), (0.8, rim, 0.0), (FLANGE_HEIGHT, rim, FLANGE_EDGE)])
    )
    part.cut(rod(SEAT_DIAMETER, TOP_CENTRE, 90.0))
    bolts = around(BOLTS, BOLT_CIRCLE)
    floor = FLANGE_HEIGHT - BOLT_DEPTH
    part.cut(*(rod(COUNTERBORE, floor, 20.0, at=(x, y, 0.0)) for x, y in bolts), of=GREY)
    screws(part, [(x, y, floor) for x, y in bolts], "+z", BOLT_HEAD)
    front, half = PANEL_Y - PANEL_STANDS, PANEL_HALF_WIDTH
    sheet = rectangle((-half, half), PANEL_Z, PANEL_CORNER)
    part.add(PANEL, prism(sheet, front, PANEL_Y + 2.0, (0.6, 0.0), "y"))
    corners = [
        (x, front, z)
        for x in (4.5 - half, half - 4.5)
        for z in (PANEL_Z[0] + 4.0, PANEL_Z[1] - 4.0)
    ]
    screws(part, corners, "-y", 3.4)
    connectors(part, front)
    return part
