"""The fingers: bent aluminium strips with black pads, sensor windows and a crown sector; mm.

The origin lies on the pivot, x forward, the right finger on +y. At zero the strip's foot is
parallel to x; a positive angle opens.
"""

from __future__ import annotations

import math

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from robot_description.cad.fittings import screws
from robot_description.cad.gripper import PINION_TIP
from robot_description.cad.material import BRASS, BRIGHT, LENS, PAD
from robot_description.cad.outline import Outline, circle, hull, on_grid, rectangle, rounded
from robot_description.cad.part import Part
from robot_description.cad.solid import Range, prism, rod

LUG_Z, LUG_RADIUS, LUG_X, LUG_EDGE = (6.2, 12.6), 9.4, (-3.4, 6.0), 0.8
LUG_BORE = 4.0

# The strip's centre line: foot, knee outwards, knee inwards, tip.
STRIP: tuple[tuple[float, float], ...] = (
    (-3.5, 15.6),
    (9.8, 15.6),
    (48.0, 43.0),
    (63.0, 33.4),
    (84.6, 43.4),
)
BEND_RADIUS = 6.0
STRIP_THICK, STRIP_HALF_HEIGHT = 2.2, 10.2
FOOT_X, FOOT_THICK, FOOT_HALF_HEIGHT, FOOT_CORNER = (-6.0, 7.8), 3.4, 12.4, 1.5
FOOT_SCREW_X, FOOT_SCREW_Z, FOOT_SCREW_HEAD = 3.4, 6.4, 4.6
TIP_CHAMFER = 5.0

PAD_THICK, PAD_HALF_HEIGHT, PAD_EDGE = 2.0, 9.9, 0.45
PAD_START = 7.4  # mm after the foot's bend

CROWN_TEETH, CROWN_SECTOR = 43, 9  # teeth of a full turn, and of the sector
CROWN_RADII, CROWN_BACK = (6.6, 10.6), 7.0
TOOTH_HEIGHT, TOOTH_CLEARANCE = 0.9, 0.12

WINDOW_LENGTH, WINDOW_HEIGHT, WINDOW_CORNER = 9.0, 6.0, 1.6
WINDOW_GAP, WINDOW_SUNK, WINDOW_DEPTH = 0.5, 0.25, 1.3
CONTACT_DIAMETER, CONTACT_SUNK, CONTACT_GAP = 2.6, 0.15, 0.3

# Sensor windows: (piece of the strip, fraction of its length, on the inner side).
WINDOWS = ((1, 0.66, True), (3, 0.52, True), (3, 0.52, False))
CONTACTS = ((3, 0.84), (3, 0.20))


def _path() -> Outline:
    """Return the strip's centre line with its bends rounded."""
    corners = [
        (x, y, 0.0 if k in (0, len(STRIP) - 1) else BEND_RADIUS) for k, (x, y) in enumerate(STRIP)
    ]
    closing = [(STRIP[-1][0], 200.0, 0.0), (STRIP[0][0], 200.0, 0.0)]
    return rounded([*corners, *closing])[: -len(closing)]


def _band(path: Outline, low: float, high: float) -> Outline:
    """Return the band between two distances to the left of an open ``path``, bends mitred."""
    side = np.diff(path, axis=0)
    side /= np.sqrt((side * side).sum(axis=1))[:, None]
    left = np.column_stack((-side[:, 1], side[:, 0]))
    before, after = np.vstack((left[:1], left)), np.vstack((left, left[-1:]))
    mitre = (before + after) / (1.0 + (before * after).sum(axis=1))[:, None]
    return on_grid(np.vstack((path + low * mitre, (path + high * mitre)[::-1])))


def _from(path: Outline, start: float) -> Outline:
    """Return the part of ``path`` beyond ``start`` mm of its length."""
    length = np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1))
    ends = np.concatenate(([0.0], np.cumsum(length)))
    k = int(np.searchsorted(ends, start, side="right")) - 1
    point = path[k] + (start - ends[k]) / length[k] * (path[k + 1] - path[k])
    return on_grid(np.vstack((point, path[k + 1 :])))


def _tip(half_height: float) -> Manifold:
    """Return the side view of the strip with its chamfered tip, as a prism along y."""
    end = STRIP[-1][0] + 2.0
    chamfer = TIP_CHAMFER
    return prism(
        on_grid(
            np.array(
                [
                    (-30.0, -half_height),
                    (end - chamfer, -half_height),
                    (end, chamfer - half_height),
                    (end, half_height - chamfer),
                    (end - chamfer, half_height),
                    (-30.0, half_height),
                ]
            )
        ),
        0.0,
        80.0,
        0.0,
        "y",
    )


def _along(piece: int) -> NDArray[np.float64]:
    """Return the direction of a piece of the strip."""
    step = np.array(STRIP[piece + 1]) - np.array(STRIP[piece])
    return np.asarray(step / math.dist(STRIP[piece], STRIP[piece + 1]))


def _outward(along: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([-along[1], along[0]])


def _face(piece: int, fraction: float, inner: bool) -> NDArray[np.float64]:
    """Return the frame (3, 4) on a pad's surface: x along the strip, z out of the pad."""
    start, end = np.array(STRIP[piece]), np.array(STRIP[piece + 1])
    along = _along(piece)
    out = -_outward(along) if inner else _outward(along)
    at = start + fraction * (end - start) + (STRIP_THICK / 2 + PAD_THICK) * out
    x, z = np.array([*along, 0.0]), np.array([*out, 0.0])
    return np.column_stack((x, np.cross(z, x), z, np.array([*at, 0.0])))


def pocket(radius: float) -> tuple[float, float]:
    """Return the finger angle (rad) and the distance from pivot to axis (mm) for a held cylinder.

    The cylinder is parallel to z and touches each finger before and behind the outward knee. Behind
    the knee it touches the flat or, if it is thicker, the bulge of the inward knee.
    """
    deep = STRIP_THICK / 2 + PAD_THICK  # from the centre line to the pad's surface
    before, behind, beyond = (_along(piece) for piece in (1, 2, 3))
    outer, inner = np.array(STRIP[2]), np.array(STRIP[3])
    sides = np.array([_outward(before), _outward(behind)])
    centre = np.linalg.solve(sides, sides @ outer - deep - radius)
    bulge = BEND_RADIUS * math.tan(math.acos(float(behind @ beyond)) / 2.0)
    if float(behind @ (centre - inner)) > -bulge:
        out = _outward(behind) + _outward(beyond)
        bend = inner + BEND_RADIUS * out * 2.0 / float(out @ out)
        off = centre - bend
        run = float(before @ off)
        reach = radius + BEND_RADIUS + deep
        centre = centre - (run + math.sqrt(run * run - float(off @ off) + reach * reach)) * before
    return -math.atan2(float(centre[1]), float(centre[0])), math.hypot(*centre)


def _crown() -> list[Manifold]:
    """Return the toothed sector under the lug; its middle tooth gap is on -x when half open."""
    inner, outer = CROWN_RADII
    tips = PINION_TIP + TOOTH_CLEARANCE
    root = tips + TOOTH_HEIGHT
    step = 2.0 * math.pi / CROWN_TEETH
    # The pinion meets the teeth from 17 degrees on one side of -x to 25 on the other.
    middle = math.pi + 0.5 * step
    ring = rod(2 * outer, root, CROWN_BACK) - rod(2 * inner, root - 1.0, CROWN_BACK + 1.0)
    half = (CROWN_SECTOR / 2.0) * step
    wedge = [
        (40.0 * math.cos(middle + fraction * half), 40.0 * math.sin(middle + fraction * half))
        for fraction in (-1.0, -0.5, 0.0, 0.5, 1.0)
    ]
    sector = ring ^ prism(on_grid(np.array([(0.0, 0.0), *wedge])), 0.0, 20.0)
    solids = [sector]
    for k in range(CROWN_SECTOR):
        angle = middle + (k - (CROWN_SECTOR - 1) / 2.0) * step
        c, s = math.cos(angle), math.sin(angle)
        points = []
        for radius in (inner + 0.3, outer - 0.1):
            width = radius * step
            for z, fraction in ((root + 0.2, 0.30), (tips, 0.12)):
                for side in (-1.0, 1.0):
                    v = side * fraction * width
                    points.append((radius * c - v * s, radius * s + v * c, z))
        solids.append(Manifold.hull_points(on_grid(np.array(points))))
    return solids


def _lug() -> Manifold:
    low, high = LUG_X
    foot = rectangle((low, high), (8.0, STRIP[0][1]), 1.0)
    return prism(hull(circle(LUG_RADIUS), foot), *LUG_Z, LUG_EDGE, "z") - rod(LUG_BORE, 0.0, 20.0)


def _pads(part: Part, path: Outline) -> None:
    """Add the black pads on both faces, with windows and contacts."""
    end = _from(path, STRIP[1][0] - STRIP[0][0] + PAD_START)
    half = STRIP_THICK / 2
    tip = _tip(PAD_HALF_HEIGHT)
    for low, high in ((-half - PAD_THICK, -half), (half, half + PAD_THICK)):
        band = _band(end, low, high)
        part.add(PAD, prism(band, -PAD_HALF_HEIGHT, PAD_HALF_HEIGHT, PAD_EDGE) ^ tip)

    def pane(length: float, height: float, levels: Range) -> Manifold:
        u, v = length / 2, height / 2
        return prism(rectangle((-u, u), (-v, v), WINDOW_CORNER), *levels)

    for piece, fraction, inner in WINDOWS:
        frame = _face(piece, fraction, inner)
        gap = 2 * WINDOW_GAP
        hole = pane(WINDOW_LENGTH + gap, WINDOW_HEIGHT + gap, (-WINDOW_DEPTH, 1.0))
        part.cut(hole.transform(frame), of=PAD)
        glass = pane(WINDOW_LENGTH, WINDOW_HEIGHT, (-WINDOW_DEPTH - 0.3, -WINDOW_SUNK))
        part.add(LENS, glass.transform(frame))
    for piece, fraction in CONTACTS:
        frame = _face(piece, fraction, True)
        hole = rod(CONTACT_DIAMETER + 2 * CONTACT_GAP, -0.8, 1.0, segments=12)
        part.cut(hole.transform(frame), of=PAD)
        stud = rod(CONTACT_DIAMETER, -1.2, -CONTACT_SUNK, edge=0.3, segments=12)
        part.add(BRIGHT, stud.transform(frame))


def _finger(link: str) -> Part:
    """Return the finger on +y."""
    part = Part(link)
    path = _path()
    half = STRIP_THICK / 2
    strip = prism(_band(path, -half, half), -STRIP_HALF_HEIGHT, STRIP_HALF_HEIGHT)
    foot = rectangle(FOOT_X, (-FOOT_HALF_HEIGHT, FOOT_HALF_HEIGHT), FOOT_CORNER)
    face = STRIP[0][1] + FOOT_THICK / 2
    part.add(
        BRIGHT,
        strip ^ _tip(STRIP_HALF_HEIGHT),
        prism(foot, face - FOOT_THICK, face, 0.5, "y"),
        _lug(),
    )
    part.add(BRASS, *_crown())
    _pads(part, path)
    heads = [(FOOT_SCREW_X, face, z) for z in (-FOOT_SCREW_Z, FOOT_SCREW_Z)]
    screws(part, heads, "+y", FOOT_SCREW_HEAD)
    return part


def finger_right_link() -> Part:
    """Return the finger on +y in its frame."""
    return _finger("finger_right_link")


def finger_left_link() -> Part:
    """Return the finger on -y in its frame: the right one turned by half a turn about x."""
    part = Part("finger_left_link")
    for material, solid in _finger(part.link).bodies():
        part.add(material, solid.rotate((180.0, 0.0, 0.0)))
    return part
