"""base_link: the control box, from the table top up, connector panel towards -y; mm."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from robot_description.cad.fittings import screws
from robot_description.cad.material import ALUMINIUM, BRIGHT, GREEN, PANEL, PLASTIC, STEEL
from robot_description.cad.outline import rectangle
from robot_description.cad.part import Part
from robot_description.cad.solid import around, block, lathe, prism, rod

FLANGE_DIAMETER, FLANGE_HEIGHT, FLANGE_EDGE = 242.0, 8.0, 1.6
BOLTS, BOLT_CIRCLE, COUNTERBORE, BOLT_HEAD = 6, 113.0, 11.0, 8.5
DRUM_DIAMETER, DRUM_EDGE = 195.0, 4.0
TOP_CENTRE = 73.0  # where the arm's base stands
TOP_RISE, TOP_SAG = 10.0, 6.0  # of the saddle at the rim, towards y and towards x
SEAT_DIAMETER = 112.0
PANEL_Y = -72.0
RIM_UNDERSIDE = 69.5
PANEL_HALF_WIDTH, PANEL_Z, PANEL_CORNER = 57.0, (13.0, 65.0), 7.0
PANEL_STANDS = 1.4
STRIP_X, STRIP_Z, STRIP_DEPTH, TERMINALS = (-46.0, 34.0), (53.0, 60.5), 5.0, 10
SOCKET_STANDS = 1.6


def _saddle(points: NDArray[np.float64]) -> NDArray[np.float64]:
    bent = np.array(points)
    rim = DRUM_DIAMETER / 2
    lift = TOP_RISE * (bent[:, 1] / rim) ** 2 - TOP_SAG * (bent[:, 0] / rim) ** 2
    bent[:, 2] += np.where(bent[:, 2] > TOP_CENTRE / 2, lift, 0.0)
    return bent


def _drum() -> Manifold:
    rim = DRUM_DIAMETER / 2
    shell = lathe(
        [(FLANGE_HEIGHT - 2.0, rim, 0.0), (TOP_CENTRE, rim, DRUM_EDGE)]
        + [(TOP_CENTRE, rim * share, 0.0) for share in (0.9, 0.8, 0.7, 0.6, 0.5)]
    )
    return shell.warp_batch(_saddle)


def _panel(part: Part) -> None:
    front = PANEL_Y - PANEL_STANDS
    half = PANEL_HALF_WIDTH
    sheet = rectangle((-half, half), PANEL_Z, PANEL_CORNER)
    part.add(PANEL, prism(sheet, front, PANEL_Y + 2.0, (0.6, 0.0), "y"))
    part.add(GREEN, block(STRIP_X, (front - STRIP_DEPTH, front + 1.0), STRIP_Z, 0.5))
    pitch = (STRIP_X[1] - STRIP_X[0]) / TERMINALS
    for k in range(TERMINALS):
        x = STRIP_X[0] + (k + 0.5) * pitch
        part.cut(
            block((x - 2.6, x + 2.6), (front - 9.0, front - 2.5), (STRIP_Z[0] + 1.4, STRIP_Z[1])),
            of=GREEN,
        )
        part.add(STEEL, rod(3.0, 0.0, 3.6, "-y", (x, front, sum(STRIP_Z) / 2), segments=12))
    sockets = (  # x range, z range of the metal shell; the dark mouth lies inside
        ((-50.0, -34.0), (22.0, 37.0)),
        ((-29.0, -13.0), (22.0, 37.0)),
        ((-7.0, 3.0), (22.0, 33.0)),
        ((10.0, 24.5), (22.0, 29.0)),
        ((10.0, 24.5), (32.0, 39.0)),
    )
    for wide, tall in sockets:
        part.add(BRIGHT, block(wide, (front - SOCKET_STANDS, front + 1.0), tall, 0.5))
        mouth_x, mouth_z = (wide[0] + 1.3, wide[1] - 1.3), (tall[0] + 1.3, tall[1] - 1.3)
        part.cut(block(mouth_x, (front - 9.0, front - 0.3), mouth_z), of=BRIGHT)
        part.add(PLASTIC, block(mouth_x, (front - 0.6, front + 0.8), mouth_z))
    part.add(GREEN, block((36.0, 48.0), (front - 4.5, front + 1.0), (21.0, 31.0), 0.6))
    part.add(STEEL, rod(3.0, 0.0, 5.0, "-y", (39.5, front, 26.0), segments=12))
    part.add(STEEL, rod(3.0, 0.0, 5.0, "-y", (44.5, front, 26.0), segments=12))
    part.add(BRIGHT, rod(13.0, -1.0, 1.4, "-y", (42.0, front, 46.0), edge=0.5))
    part.add(PLASTIC, rod(9.0, -1.0, 2.6, "-y", (42.0, front, 46.0), edge=0.6))
    corners = [(x, front, z) for x in (-52.0, 52.0) for z in (17.5, 60.5)]
    screws(part, corners, "-y", 3.4)


def base_link() -> Part:
    """Return the control box in its frame: z 0 on the table."""
    part = Part("base_link")
    rim = FLANGE_DIAMETER / 2
    part.add(
        ALUMINIUM,
        lathe([(0.0, rim, 0.6), (FLANGE_HEIGHT, rim, FLANGE_EDGE)]),
        _drum(),
    )
    part.cut(
        block((-99.0, 99.0), (-99.0, PANEL_Y), (FLANGE_HEIGHT, RIM_UNDERSIDE)),
        rod(SEAT_DIAMETER, TOP_CENTRE, 90.0),
    )
    bolts = around(BOLTS, BOLT_CIRCLE)
    part.cut(*(rod(COUNTERBORE, FLANGE_HEIGHT - 5.0, 20.0, at=(x, y, 0.0)) for x, y in bolts))
    _panel(part)
    screws(part, [(x, y, FLANGE_HEIGHT - 5.0) for x, y in bolts], "+z", BOLT_HEAD)
    return part
