"""roll_link: the cylinder that carries the gripper, with the dome over its drive; mm.

The origin lies in the middle of the cylinder, x along the roll axis, the dome on +z.
"""

from __future__ import annotations

from manifold3d import Manifold

from robot_description.cad.fittings import Sideways, screws
from robot_description.cad.material import ALUMINIUM, BRIGHT, PANEL, PLASTIC
from robot_description.cad.outline import rectangle
from robot_description.cad.part import Part
from robot_description.cad.solid import block, lathe, prism, rod

RADIUS, BODY_X = 25.0, (-30.0, 30.0)
SEGMENTS = 60  # of the turned surfaces
SPIGOT_RADIUS, SPIGOT_LENGTH = 21.0, 1.5
FOOT_RING, SEAM_WIDTH, SEAM_DEPTH = 3.6, 0.9, 0.6  # a seam above a narrow ring at the foot

RING_X, RING_FLATS = (29.0, 32.3), 22.0
FLANGE_RADIUS, FLANGE_X, FLANGE_EDGE = 20.0, (30.0, 36.0), 0.5
KEY_HALF_WIDTH, KEY_REACH, KEY_TOP = 4.0, 25.0, 35.0

DOME_X, DOME_RADIUS, DOME_NECK = 0.0, 24.0, 20.5
DOME_NECK_TOP, DOME_RIM, DOME_TOP, DOME_CROWN = 22.0, 24.4, 32.0, 1.2
DOME_EDGE = 5.2

FLAT_Y, FLAT_X = 22.8, (-22.5, 27.6)  # milled on both sides, under a cover
COVER_X, COVER_HALF_HEIGHT, COVER_THICK, COVER_CORNER = (-21.6, 26.8), 9.2, 1.0, 1.6
COVER_SCREW_X, COVER_SCREW_Z, COVER_SCREW_HEAD = (-3.0, 24.0), 7.1, 2.6
LAMP_X, LAMPS_Z, LAMP_DIAMETER = -18.2, (-4.2, 0.0, 4.2), 2.4


def _body() -> Manifold:
    low, high = BODY_X
    foot = low + SPIGOT_LENGTH
    seam = foot + FOOT_RING
    inner = RADIUS - SEAM_DEPTH
    return lathe(
        [
            (low, SPIGOT_RADIUS, 0.0),
            (foot, SPIGOT_RADIUS, 0.0),
            (foot, RADIUS, 0.7),
            (seam, RADIUS, 0.4),
            (seam, inner, 0.0),
            (seam + SEAM_WIDTH, inner, 0.0),
            (seam + SEAM_WIDTH, RADIUS, 0.4),
            (high - 1.6, RADIUS, 0.4),
            (high - 1.6, inner, 0.0),
            (high, inner, 0.0),
        ],
        "+x",
        segments=SEGMENTS,
    )


def _ring() -> Manifold:
    ring = rod(2 * RADIUS, *RING_X, "+x", edge=0.5, segments=SEGMENTS)
    for low, high in ((RING_FLATS, 30.0), (-30.0, -RING_FLATS)):
        ring = ring - block((25.0, 40.0), (low, high), (-30.0, 30.0))
    return ring


def _dome() -> Manifold:
    crown = [  # a shallow cap; facets of 12 degrees look smooth
        (DOME_TOP - DOME_CROWN * fraction * fraction, (DOME_RADIUS - 1.0) * fraction, 0.0)
        for fraction in (0.7, 0.35)
    ]
    return lathe(
        [
            (0.0, DOME_NECK, 0.0),
            (DOME_NECK_TOP, DOME_NECK, 0.8),
            (DOME_RIM, DOME_RADIUS, 1.3),
            (DOME_TOP - DOME_CROWN, DOME_RADIUS, DOME_EDGE),
            *crown,
        ],
        "+z",
        (DOME_X, 0.0, 0.0),
        segments=44,
    )


def _cover(part: Part, toward: Sideways) -> None:
    """Add the light cover on one flat, with its screws and the three lamps at its foot."""
    sign = 1.0 if toward == "+y" else -1.0
    face = FLAT_Y + COVER_THICK
    sheet = rectangle(COVER_X, (-COVER_HALF_HEIGHT, COVER_HALF_HEIGHT), COVER_CORNER)
    ends = sorted((sign * (FLAT_Y - 1.0), sign * face))
    edges = (0.0, 0.4) if sign > 0.0 else (0.4, 0.0)
    part.add(PANEL, prism(sheet, ends[0], ends[1], edges, "y"))
    spots = [(x, z) for x in COVER_SCREW_X for z in (-COVER_SCREW_Z, COVER_SCREW_Z)]
    screws(part, [(x, sign * (face - 0.6), z) for x, z in spots], toward, COVER_SCREW_HEAD)
    for z in LAMPS_Z:
        at = (LAMP_X, sign * face, z)
        part.add(PLASTIC, rod(LAMP_DIAMETER, -0.5, 0.4, toward, at, segments=10))


def roll_link() -> Part:
    """Return the roll cylinder in its frame."""
    part = Part("roll_link")
    body = _body()
    for low, high in ((FLAT_Y, 40.0), (-40.0, -FLAT_Y)):
        body = body - block(FLAT_X, (low, high), (-30.0, 30.0))
    part.add(ALUMINIUM, body, _ring(), _dome())
    part.add(
        BRIGHT,
        rod(2 * FLANGE_RADIUS, *FLANGE_X, "+x", edge=FLANGE_EDGE),
        block((FLANGE_X[0], KEY_TOP), (-KEY_HALF_WIDTH, KEY_HALF_WIDTH), (-KEY_REACH, -15.0), 0.4),
    )
    _cover(part, "+y")
    _cover(part, "-y")
    return part
