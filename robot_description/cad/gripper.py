"""gripper_link: the gripper's body, a turned cone milled to a fork around the finger drive; mm.

The origin lies on the back of its plate, x forward. The fingers share a pivot along z. A pinion on
x drives a crown sector on each, from both sides, so that they turn in opposite directions.
"""

from __future__ import annotations

import math

import numpy as np
from manifold3d import JoinType, Manifold, OpType

from robot_description.cad import roll
from robot_description.cad.fittings import screws
from robot_description.cad.material import ALUMINIUM, BRASS, BRIGHT, LENS, PLASTIC, STEEL
from robot_description.cad.outline import Outline, on_grid, rectangle, rounded
from robot_description.cad.part import Part
from robot_description.cad.solid import Direction, block, lathe, prism, rod

PLATE_RADIUS, PLATE_THICK, PLATE_EDGE = 25.0, 2.0, 0.5
BOLTS, BOLT_HEAD, BOLT_POCKET = 15.8, 4.4, 5.4  # (+-15.8, +-15.8) from the axis
COLLAR_RADIUS, COLLAR_END = 21.6, 4.5
GROOVE_RADIUS = 18.4
SOCKET_CLEARANCE = 0.1  # around the roll link's flange, which fits into the plate

SEGMENTS = 60  # of the turned surfaces

CONE_RADIUS, CONE_X, CONE_TAPER = 20.0, (5.3, 48.5), 3.6
CONE_RINGS = 6  # facets, each a degree steeper than the last, which keep the flats' edges crisp
FLAT_X, FLAT_SINKS, FLAT_RIM = 10.5, 0.04, 0.5  # start, depth and rim of the flats
TIP_HALF_Y, TIP_HALF_Z = 7.0, 15.5
TIP_CORNER = 4.0

WINDOW_X, WINDOW_HALF_Z, WINDOW_CORNER, WINDOW_RIM = (22.0, 46.6), 13.0, 2.0, 0.6
LINING_THICK, LINING_HALF_Z, LINING_HALF_Y = 0.8, 12.4, 9.0
BEARING_RADIUS, BEARING_END = 4.6, 23.1

PIVOT_X, PIN_DIAMETER = 34.0, 3.7
PIN_HEAD, PIN_HEAD_Z = 7.4, (15.0, 18.0)

# A pinion of 14 teeth and a full crown of 43 give the manufacturer's ratio 0.3254.
PINION_TEETH, PINION_X = 14, (23.0, 27.4)
PINION_TIP, PINION_ROOT = 3.25, 2.35
EYE_DIAMETER = 5.0
EYE_BEZEL = 7.4


def _wedge(half: float) -> Outline:
    """Return a view of the body: the cone's full width down to ``half`` at the tip."""
    low, high = CONE_X
    start = low - 5.0
    root = half + (CONE_RADIUS - half) * (high - start) / (high - FLAT_X)
    return rounded(
        [
            (start, -root, 0.0),
            (high, -half, TIP_CORNER),
            (high, half, TIP_CORNER),
            (start, root, 0.0),
        ]
    )


def _milled(blank: Manifold, half: float, roll: float) -> Manifold:
    """Return the solid to remove for the flat of ``blank`` that ends ``half`` off the axis.

    The flat lies FLAT_SINKS deep inside a narrow rim, so that it is shaded flat and the rim catches
    the light. ``half`` is measured at the tip. ``roll`` (degrees about x) selects the flat.
    """
    tilt = math.degrees(math.atan((CONE_RADIUS - half) / (CONE_X[1] - FLAT_X)))
    level_with = blank.rotate((-roll, 0.0, 0.0)).rotate((0.0, -tilt, 0.0))
    top = level_with.bounding_box()[5]
    outline = level_with.slice(top - 2 * FLAT_SINKS).offset(-FLAT_RIM, JoinType.Miter)
    tool = outline.extrude(1.0).translate((0.0, 0.0, top - FLAT_SINKS))
    return tool.rotate((0.0, tilt, 0.0)).rotate((roll, 0.0, 0.0))


def _cone() -> Manifold:
    """Return the blank of the body: turned to a slight barrel, with four flats towards the tip."""
    low, high = CONE_X
    profile = [
        (
            low + fraction * (high - low),
            CONE_RADIUS - CONE_TAPER * fraction * (1.0 + fraction) / 2.0,
            0.0,
        )
        for fraction in (k / CONE_RINGS for k in range(1, CONE_RINGS + 1))
    ]
    turned = lathe([(low, CONE_RADIUS, 0.8), *profile], "+x", segments=SEGMENTS)
    sides = prism(_wedge(TIP_HALF_Y), -40.0, 40.0, 0.0, "z")
    cheeks = prism(_wedge(TIP_HALF_Z), -40.0, 40.0, 0.0, "y")
    blank = turned ^ sides ^ cheeks
    flats = [(TIP_HALF_Z, 0.0), (TIP_HALF_Y, 90.0), (TIP_HALF_Z, 180.0), (TIP_HALF_Y, 270.0)]
    tools = [_milled(blank, half, roll) for half, roll in flats]
    return Manifold.batch_boolean([blank, *tools], OpType.Subtract)


def _window() -> list[Manifold]:
    """Return the solids to cut for the window: a slot through both flats, with chamfered rims."""
    (low, high), half = WINDOW_X, WINDOW_HALF_Z
    slot = prism(rectangle(WINDOW_X, (-half, half), WINDOW_CORNER), -30.0, 30.0, 0.0, "y")
    slope = (CONE_RADIUS - TIP_HALF_Y) / (CONE_X[1] - FLAT_X)
    middle = (low + high) / 2
    reach = (high - low) / 2 * math.hypot(1.0, slope) + WINDOW_RIM
    rim = prism(
        rectangle((-reach, reach), (-half - WINDOW_RIM, half + WINDOW_RIM), WINDOW_CORNER + 0.6),
        -WINDOW_RIM,
        4.0,
        (WINDOW_RIM, 0.0),
        "y",
    )
    turned = rim.rotate((0.0, 0.0, -math.degrees(math.atan(slope))))
    cut = turned.translate((middle, TIP_HALF_Y + slope * (CONE_X[1] - middle), 0.0))
    return [slot, cut, cut.mirror((0.0, 1.0, 0.0))]


def _pinion() -> Manifold:
    step = 2.0 * math.pi / PINION_TEETH
    points = [
        (radius * math.cos((k + fraction) * step), radius * math.sin((k + fraction) * step))
        for k in range(PINION_TEETH)
        for fraction, radius in (
            (-0.30, PINION_ROOT),
            (-0.12, PINION_TIP),
            (0.12, PINION_TIP),
            (0.30, PINION_ROOT),
        )
    ]
    # One tooth points to each crown, on +z and on -z.
    turn = math.pi / 2.0
    turned = [
        (u * math.cos(turn) - v * math.sin(turn), u * math.sin(turn) + v * math.cos(turn))
        for u, v in points
    ]
    return prism(on_grid(np.array(turned)), *PINION_X, 0.0, "x")


def gripper_link() -> Part:
    """Return the gripper's body in its frame."""
    part = Part("gripper_link")
    low = WINDOW_X[0]
    part.add(
        ALUMINIUM,
        Manifold.batch_boolean([_cone(), *_window()], OpType.Subtract),
        lathe(
            [
                (0.0, PLATE_RADIUS, PLATE_EDGE),
                (PLATE_THICK, PLATE_RADIUS, PLATE_EDGE),
                (PLATE_THICK, COLLAR_RADIUS, 0.0),
                (COLLAR_END, COLLAR_RADIUS, 0.6),
                (COLLAR_END, GROOVE_RADIUS, 0.0),
                (CONE_X[0] + 1.0, GROOVE_RADIUS, 0.0),
            ],
            "+x",
            segments=SEGMENTS,
        ),
    )
    bolts = [(u, v) for u in (-BOLTS, BOLTS) for v in (-BOLTS, BOLTS)]
    part.cut(
        *(rod(BOLT_POCKET, PLATE_THICK, 5.2, "+x", (0.0, u, v), segments=20) for u, v in bolts)
    )
    screws(part, [(PLATE_THICK, u, v) for u, v in bolts], "+x", BOLT_HEAD)

    part.add(
        PLASTIC,
        block(
            (low - 1.0, low + LINING_THICK),
            (-LINING_HALF_Y, LINING_HALF_Y),
            (-LINING_HALF_Z, LINING_HALF_Z),
        ),
    )
    part.add(STEEL, rod(2 * BEARING_RADIUS, low, BEARING_END, "+x", edge=0.5))
    part.add(BRASS, _pinion())
    pivot = (PIVOT_X, 0.0, 0.0)
    part.add(STEEL, rod(PIN_DIAMETER, -16.0, 16.0, "+z", pivot, segments=16))
    toward: Direction
    for toward in ("+z", "-z"):
        part.add(BRIGHT, rod(PIN_HEAD, *PIN_HEAD_Z, toward, pivot, edge=0.6))
        part.cut(rod(3.4, PIN_HEAD_Z[1] - 1.4, 25.0, toward, pivot, segments=6), of=BRIGHT)

    front = CONE_X[1]
    part.cut(rod(EYE_BEZEL - 0.4, front - 0.5, 60.0, "+x"), of=ALUMINIUM)
    bezel = rod(EYE_BEZEL, front - 0.7, front + 0.4, "+x", edge=0.3)
    part.add(BRIGHT, bezel - rod(EYE_DIAMETER, front - 2.0, 60.0, "+x"))
    part.add(LENS, rod(EYE_DIAMETER + 0.4, front - 0.6, front, "+x", edge=0.2))

    hollow = roll.FLANGE_X[1] - roll.RING_X[1] + SOCKET_CLEARANCE
    key = roll.KEY_HALF_WIDTH + SOCKET_CLEARANCE
    part.cut(
        rod(2 * (roll.FLANGE_RADIUS + SOCKET_CLEARANCE), -1.0, hollow, "+x"),
        block((-1.0, hollow), (-key, key), (-roll.KEY_REACH - 2.0, -15.0)),
        of=ALUMINIUM,
    )
    return part
