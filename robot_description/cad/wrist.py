"""wrist_link: a fork and the round housing whose end face carries the roll joint; mm.

The origin lies on the wrist's axis, x along the link and the roll axis, y along the wrist's axis.
"""

from __future__ import annotations

from manifold3d import Manifold

from robot_description.cad import conduit
from robot_description.cad.fittings import (
    bored,
    hub,
    name_round,
    screws,
    seam,
    terminal_box,
)
from robot_description.cad.forearm import WRIST_SHAFT, WRIST_SHAFT_Y
from robot_description.cad.fork import CHEEK_THICK, cheeks, steps
from robot_description.cad.material import ALUMINIUM, BLUE, RUBBER, STEEL
from robot_description.cad.part import Part
from robot_description.cad.solid import lathe, placed

CHEEK_INSIDE, CHEEK_NOSE = 19.5, 42.0
STEP_DIAMETER, STEP_END = 52.0, 44.5
DISC_DIAMETER, DISC_END, CAP_DIAMETER, CAP_END = 54.0, 55.0, 23.0, 56.0
BOX_X, BOX_Y, BOX_Z = (31.5, 55.0), (28.5, 71.5), (-19.0, 19.0)
HOUSING_DIAMETER, HOUSING_X = 60.0, (62.5, 122.0)
FOOT_DIAMETER, FOOT_END = 65.0, 72.0
SEAMS_X = (79.0, 100.5)
BUMPER_DIAMETER, BUMPER_X, BUMPER_EDGE = 76.0, (102.5, 119.0), 3.6
NAME_HEIGHT, NAME_AT, NAME_AZIMUTH = 7.5, 90.0, 140.0


def _housing() -> Manifold:
    low, high = HOUSING_X
    radius, foot = HOUSING_DIAMETER / 2, FOOT_DIAMETER / 2
    return lathe(
        [
            (low, foot - 4.0, 0.0),
            (low + 4.0, foot, 0.0),
            (FOOT_END, foot, 1.6),
            (FOOT_END, radius, 0.0),
            (high - 1.2, radius, 1.0),
            (high - 1.2, radius - 5.0, 0.0),
            (high, radius - 5.0, 0.5),
        ],
        "+x",
    )


def wrist_link() -> Part:
    """Return the wrist in its frame."""
    part = Part("wrist_link")
    end = CHEEK_INSIDE + CHEEK_THICK
    part.add(
        ALUMINIUM,
        *cheeks(CHEEK_INSIDE, CHEEK_NOSE),
        *steps(STEP_DIAMETER, end, STEP_END),
        _housing(),
    )
    bored(part, WRIST_SHAFT, max(map(abs, WRIST_SHAFT_Y)) + 0.8)
    bumper = BUMPER_DIAMETER / 2
    part.add(STEEL, *(seam(HOUSING_DIAMETER / 2, x, FOOT_DIAMETER / 2, "+x") for x in SEAMS_X))
    part.add(
        RUBBER,
        lathe(
            [
                (BUMPER_X[0], bumper, BUMPER_EDGE),
                (BUMPER_X[1], bumper, BUMPER_EDGE),
            ],
            "+x",
        ),
    )
    hub(part, (STEP_END, DISC_END), DISC_DIAMETER, CAP_DIAMETER, CAP_END)
    terminal_box(part, BOX_X, BOX_Y, BOX_Z, (conduit.WRIST,))
    screws(part, [(62.0, -end, z) for z in (-14.0, 14.0)], "-y", 5.0)
    text = name_round("katana450", NAME_HEIGHT, HOUSING_DIAMETER / 2, NAME_AZIMUTH)
    part.add(BLUE, placed(text, "+x").translate((NAME_AT, 0.0, 0.0)))
    return part
