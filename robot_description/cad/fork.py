"""Common elements of the forks at shoulder, elbow and wrist: cheeks, steps, covers, shafts; mm."""

from __future__ import annotations

from manifold3d import Manifold

from robot_description.cad.outline import Outline, circle, hull, toothed
from robot_description.cad.solid import Range, lathe, prism, rod

TUBE_DIAMETER = 34.0
CLAMP_DIAMETER, CLAMP_LENGTH = 41.0, 10.0

BELLOWS_RADIUS, BELLOWS_HALF, BELLOWS_PLEATS, BELLOWS_DEPTH = 43.2, 21.4, 44, 1.8
COVER_RIBS, COVER_GROOVE, COVER_EDGE = 16, 3.0, 1.25

CHEEK_RADIUS, CHEEK_NOSE_RADIUS, CHEEK_THICK = 38.0, 30.0, 10.0
CHEEK_EDGE_OUTSIDE, CHEEK_EDGE_INSIDE = 3.0, 0.8
PLATE_THICK, PLATE_SEAM = 3.2, 0.7


def clamp(x: float) -> Manifold:
    """Return the clamp around the tube at ``x``: two rings with a groove between them."""
    radius, half = CLAMP_DIAMETER / 2, CLAMP_LENGTH / 2
    return lathe(
        [
            (x - half, radius, 1.2),
            (x - 0.5, radius, 0.0),
            (x - 0.5, radius - 0.9, 0.0),
            (x + 0.5, radius - 0.9, 0.0),
            (x + 0.5, radius, 0.0),
            (x + half, radius, 1.2),
        ],
        "+x",
    )


def bellows() -> Manifold:
    """Return the pleated drum that fills the shoulder's slot."""
    pleat = ((0.0, BELLOWS_DEPTH), (0.3, 0.0), (0.7, 0.0))
    ring = toothed(BELLOWS_RADIUS, pleat, BELLOWS_PLEATS)
    return prism(ring, -BELLOWS_HALF, BELLOWS_HALF, 0.0, "y")


def cover(radius: float, half: float, x: float, ribs: int = COVER_RIBS) -> Manifold:
    """Return the motor cover between two cheeks: broad ribs with bevelled ends."""
    depth = COVER_GROOVE
    rib = ((0.0, depth), (0.05, 0.9), (0.13, 0.0), (0.59, 0.0), (0.67, 0.9), (0.72, depth))
    return prism(toothed(radius, rib, ribs, (x, 0.0)), -half, half, COVER_EDGE, "y")


def egg(nose: float) -> Outline:
    """Return the outline of a cheek around the joint, with its nose at ``nose`` along the link."""
    return hull(circle(CHEEK_RADIUS), circle(CHEEK_NOSE_RADIUS, (nose, 0.0)))


def cheeks(inside: float, nose: float) -> list[Manifold]:
    """Return both cheeks; each is a thin plate and a thick plate with a seam between them."""
    outline = egg(nose)
    inner, outer, fine = CHEEK_EDGE_INSIDE, CHEEK_EDGE_OUTSIDE, PLATE_SEAM
    middle, end = inside + PLATE_THICK, inside + CHEEK_THICK
    return [
        prism(outline, inside, middle, (inner, fine), "y"),
        prism(outline, middle, end, (fine, outer), "y"),
        prism(outline, -middle, -inside, (fine, inner), "y"),
        prism(outline, -end, -middle, (outer, fine), "y"),
    ]


def steps(diameter: float, start: float, end: float) -> list[Manifold]:
    """Return the hub's step on both sides: a broad low ring and the round boss on it."""
    radius, foot = diameter / 2, start + 2.2
    profile = [
        (start - 1.0, radius + 4.0, 0.0),
        (foot, radius + 4.0, 1.2),
        (foot, radius, 0.0),
        (end, radius, 1.5),
    ]
    return [lathe(profile, "+y"), lathe(profile, "-y")]


def shaft(diameter: float, y: Range, x: float) -> Manifold:
    """Return the cross cylinder that turns in the next fork; coarse, because the fork hides it."""
    return rod(diameter, y[0], y[1], "+y", (x, 0.0, 0.0), segments=20)
