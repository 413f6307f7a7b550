"""roll_link, gripper_link and the two fingers, each pointing along +x; mm."""

from __future__ import annotations

import math

import numpy as np
from manifold3d import Manifold

from robot_description.cad.fittings import Sideways, name, screws
from robot_description.cad.material import ALUMINIUM, BRIGHT, PANEL, RUBBER, STEEL
from robot_description.cad.outline import Outline, circle, hull, on_grid, rectangle, rounded
from robot_description.cad.part import Part
from robot_description.cad.solid import block, lathe, prism, rod

# roll_link: the origin in the middle of the cylinder, the side dome on +z.
ROLL_DIAMETER, ROLL_X = 50.0, (-30.0, 30.0)
RING_X, RING_FLATS = (30.0, 32.5), 22.0
FLANGE_DIAMETER, FLANGE_X = 40.0, (33.0, 36.0)
DOME_DIAMETER, DOME_TOP, DOME_X = 46.0, 32.0, -4.0
PLATE_HALF_WIDTH, PLATE_X, PLATE_STANDS = 9.5, (-24.0, 24.0), 0.9

# gripper_link: the origin on the back of its plate.
PLATE_DIAMETER, PLATE_THICK, PLATE_HOLE = 50.0, 2.0, 16.0
NECK_DIAMETER = 35.0
CONE_DIAMETER, CONE_START, CONE_END = 40.0, 5.0, 48.5
TIP_Y, TIP_Z = 14.0, 31.0
WINDOW_X, WINDOW_HALF_Z = 22.0, 13.0
PIVOT_X, PIN_DIAMETER = 34.0, 7.0

# Fingers: the origin on the pivot; the right one lies on +y.
LUG_Z, LUG_RADIUS, LUG_END = (6.2, 12.6), 9.4, 14.0
LUG_BORE = 4.0
STRIP = ((4.2, 11.8), (11.5, 17.0), (48.0, 43.0), (63.0, 33.4), (84.6, 43.4))
STRIP_HALF_HEIGHT, ROOT_HALF_HEIGHT = 10.0, 12.5
ROOT_REACH = 16.5  # how far the root stands out from the first point of the strip
STRIP_THICK, PAD_THICK = 2.2, 2.0
PAD_START, PAD_HALF_HEIGHT = 16.8, 10.8
BEND_RADIUS = 4.0


def roll_link() -> Part:
    """Return the roll cylinder in its frame: x the roll axis."""
    part = Part("roll_link")
    radius = ROLL_DIAMETER / 2
    low, high = ROLL_X
    ring = rod(ROLL_DIAMETER, high - 1.0, RING_X[1], "+x", edge=0.5)
    ring = ring - block((0.0, 40.0), (RING_FLATS, 30.0), (-30.0, 30.0))
    ring = ring - block((0.0, 40.0), (-30.0, -RING_FLATS), (-30.0, 30.0))
    dome = DOME_DIAMETER / 2
    part.add(
        ALUMINIUM,
        lathe(
            [
                (low, radius - 4.0, 0.0),
                (low + 1.5, radius - 4.0, 0.0),
                (low + 1.5, radius, 1.0),
                (low + 5.0, radius, 0.0),
                (low + 5.0, radius - 0.7, 0.0),
                (low + 6.2, radius - 0.7, 0.0),
                (low + 6.2, radius, 0.0),
                (high - 0.6, radius, 1.0),
            ],
            "+x",
        ),
        ring,
        lathe(
            [
                (0.0, dome - 4.0, 0.0),
                (DOME_TOP - 12.0, dome - 4.0, 1.0),
                (DOME_TOP - 8.5, dome, 1.2),
                (DOME_TOP, dome, 7.5),
            ],
            "+z",
            (DOME_X, 0.0, 0.0),
        ),
    )
    part.add(
        BRIGHT,
        rod(FLANGE_DIAMETER, high, FLANGE_X[1], "+x", edge=0.4),
        block((high, FLANGE_X[1]), (-4.0, 4.0), (-25.0, -15.0), 0.4),
    )
    half = PLATE_HALF_WIDTH
    sheet = rectangle(PLATE_X, (-half, half), 2.0)
    inside, outside = radius - 4.0, radius + PLATE_STANDS
    part.add(
        PANEL,
        prism(sheet, inside, outside, (0.0, 0.5), "y"),
        prism(sheet, -outside, -inside, (0.5, 0.0), "y"),
    )
    toward: Sideways
    for toward, y in (("+y", outside), ("-y", -outside)):
        screws(part, [(x, y, z) for x in (-21.0, 21.0) for z in (-6.5, 6.5)], toward, 3.0)
        name(part, "KATANA", 5.5, (0.0, y, 0.0), toward)
    corners = [(RING_X[1], u, v) for u in (-15.8, 15.8) for v in (-15.8, 15.8)]
    screws(part, corners, "+x", 5.0)
    return part


def gripper_link() -> Part:
    """Return the gripper's body, a fork that flattens towards the finger pivots."""
    part = Part("gripper_link")
    tip = prism(
        rectangle((-TIP_Y / 2, TIP_Y / 2), (-TIP_Z / 2, TIP_Z / 2), 2.0),
        CONE_END - 1.5,
        CONE_END,
        (0.0, 0.6),
        "x",
    )
    root = rod(CONE_DIAMETER, CONE_START, CONE_START + 5.0, "+x", edge=1.0)
    body = Manifold.batch_hull([root, tip])
    half = WINDOW_HALF_Z
    body = body - prism(
        rounded(
            [(WINDOW_X, -half, 3.0), (60.0, -half, 0.0), (60.0, half, 0.0), (WINDOW_X, half, 3.0)]
        ),
        -30.0,
        30.0,
        0.0,
        "y",
    )
    part.add(ALUMINIUM, body, rod(NECK_DIAMETER, 1.0, CONE_START + 1.0, "+x"))
    part.add(ALUMINIUM, rod(PLATE_DIAMETER, 0.0, PLATE_THICK, "+x", edge=0.5))
    corners = [
        (PLATE_THICK, u, v) for u in (-PLATE_HOLE, PLATE_HOLE) for v in (-PLATE_HOLE, PLATE_HOLE)
    ]
    screws(part, corners, "+x", 4.6)
    part.add(STEEL, rod(LUG_BORE - 0.3, -16.0, 16.0, "+z", (PIVOT_X, 0.0, 0.0), segments=16))
    pivot = (PIVOT_X, 0.0, 0.0)
    part.add(
        BRIGHT,
        rod(PIN_DIAMETER, 14.5, 17.0, "+z", pivot, edge=0.6),
        rod(PIN_DIAMETER, 14.5, 17.0, "-z", pivot, edge=0.6),
    )
    return part


def _ribbon(path: Outline, low: float, high: float) -> Outline:
    """Return the band between two distances to the left of an open ``path``, bends mitred."""
    side = np.diff(path, axis=0)
    side /= np.sqrt((side * side).sum(axis=1))[:, None]
    left = np.column_stack((-side[:, 1], side[:, 0]))
    before, after = np.vstack((left[:1], left)), np.vstack((left, left[-1:]))
    mitre = (before + after) / (1.0 + (before * after).sum(axis=1))[:, None]
    return on_grid(np.vstack((path + low * mitre, (path + high * mitre)[::-1])))


def _path(start: float) -> Outline:
    """Return the strip's bent centre line from ``start`` mm past its first point."""
    first, second = np.array(STRIP[0]), np.array(STRIP[2])
    along = (second - first) / math.dist(STRIP[0], STRIP[2])
    begin = first + start * along
    corners = [(float(begin[0]), float(begin[1]), 0.0)]
    corners += [(x, y, BEND_RADIUS) for x, y in STRIP[2:-1]]
    corners.append((*STRIP[-1], 0.0))
    closing = [(STRIP[-1][0], 200.0, 0.0), (float(begin[0]), 200.0, 0.0)]
    return rounded([*corners, *closing])[: -len(closing)]


def _finger(link: str, left: bool) -> Part:
    part = Part(link)
    root, end = _path(0.0), _path(PAD_START)
    half = STRIP_THICK / 2
    thick = half + PAD_THICK
    lug = prism(
        hull(circle(LUG_RADIUS), rectangle((-4.0, 11.5), (8.0, LUG_END + 1.5), 1.0)),
        *LUG_Z,
        0.8,
        "z",
    )
    lug = lug - rod(LUG_BORE, 0.0, 20.0)
    stub = prism(_ribbon(root, -thick, thick), -ROOT_HALF_HEIGHT, ROOT_HALF_HEIGHT)
    reach = rod(2 * ROOT_REACH, -20.0, 20.0, at=(STRIP[0][0], STRIP[0][1], 0.0))
    solids = [
        (
            ALUMINIUM,
            [
                lug,
                stub ^ reach,
                prism(_ribbon(root, -half, half), -STRIP_HALF_HEIGHT, STRIP_HALF_HEIGHT),
            ],
        ),
        (
            RUBBER,
            [
                prism(_ribbon(end, low, high), -PAD_HALF_HEIGHT, PAD_HALF_HEIGHT)
                for low, high in ((-thick, -half), (half, thick))
            ],
        ),
    ]
    for material, bodies in solids:
        for body in bodies:
            part.add(material, body.rotate((180.0, 0.0, 0.0)) if left else body)
    return part


def finger_right_link() -> Part:
    """Return the finger on +y."""
    return _finger("finger_right_link", left=False)


def finger_left_link() -> Part:
    """Return the finger on -y: the right one turned half about x."""
    return _finger("finger_left_link", left=True)
