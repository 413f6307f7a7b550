"""Closed plane outlines, counter-clockwise, in mm, from which prisms are extruded."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from manifold3d import CrossSection
from numpy.typing import NDArray

Outline = NDArray[np.float64]
"""(n, 2) corners, counter-clockwise, mm."""

SAGITTA = 0.15
"""Maximum distance of a chord from its circle, mm."""
FACETS_PER_QUARTER = 3
"""Facets per quarter turn of a fillet: 30 degrees each, less than the shading crease."""
CHAMFER_BELOW = 1.3
"""Fillets with a smaller radius, mm, become chamfers; the difference is invisible."""
GRID = 1e5
"""Points are rounded to 1/GRID mm, so that the last bit of a sine never changes a file."""


def on_grid(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round ``points`` (mm, any shape) to the grid."""
    return np.round(points * GRID) / GRID


def segments_of(radius: float) -> int:
    """Return the number of chords of a circle of ``radius`` mm: a multiple of 4, at least 12."""
    half_turn = math.acos(1.0 - min(SAGITTA / radius, 0.5))
    return max(12, 4 * math.ceil(math.pi / (4.0 * half_turn)))


def circle(radius: float, at: tuple[float, float] = (0.0, 0.0), segments: int = 0) -> Outline:
    """Return a circle of ``radius`` mm about ``at``, starting on the first axis."""
    count = segments or segments_of(radius)
    angles = [2.0 * math.pi * k / count for k in range(count)]
    points = [(at[0] + radius * math.cos(a), at[1] + radius * math.sin(a)) for a in angles]
    return on_grid(np.array(points))


def facets_of(radius: float, sweep: float = math.pi / 2.0) -> int:
    """Return the number of facets of an arc of ``radius`` mm over the angle ``sweep``."""
    if radius < CHAMFER_BELOW:
        return 1
    turn = min(math.pi / 2.0 / FACETS_PER_QUARTER, 2.0 * math.pi / segments_of(radius))
    return max(1, math.ceil(sweep / turn - 1e-9))


def fillet_points(
    before: tuple[float, float],
    corner: tuple[float, float],
    after: tuple[float, float],
    radius: float,
) -> list[tuple[float, float]]:
    """Return the points that replace ``corner`` between two others by an arc of ``radius`` mm.

    Raises:
        ValueError: the arc does not fit, because a side is shorter than the arc's tangent.
    """
    cx, cy = corner
    ax, ay = before[0] - cx, before[1] - cy
    bx, by = after[0] - cx, after[1] - cy
    a, b = math.hypot(ax, ay), math.hypot(bx, by)
    ax, ay, bx, by = ax / a, ay / a, bx / b, by / b
    opening = math.acos(max(-1.0, min(1.0, ax * bx + ay * by)))
    if radius <= 0.0 or math.pi - opening < 1e-6:
        return [corner]
    tangent = radius / math.tan(opening / 2.0)
    if tangent > min(a, b) + 1e-9:
        raise ValueError(
            f"a fillet of {radius:g} mm at {corner} needs {tangent:.3g} mm of each side, but the "
            f"sides are {a:.3g} and {b:.3g} mm: make the radius smaller"
        )
    reach = radius / math.sin(opening / 2.0)
    mx, my = ax + bx, ay + by
    middle = math.hypot(mx, my)
    ox, oy = cx + mx / middle * reach, cy + my / middle * reach
    start = math.atan2(cy + ay * tangent - oy, cx + ax * tangent - ox)
    sweep = math.atan2(cy + by * tangent - oy, cx + bx * tangent - ox) - start
    sweep = (sweep + math.pi) % (2.0 * math.pi) - math.pi
    count = facets_of(radius, abs(sweep))
    angles = [start + sweep * k / count for k in range(count + 1)]
    return [(ox + radius * math.cos(t), oy + radius * math.sin(t)) for t in angles]


def filleted(chain: Sequence[tuple[float, float, float]]) -> list[list[tuple[float, float]]]:
    """Return the arcs that replace the inner corners (u, v, fillet radius) of ``chain``, mm.

    The chain is open.

    Raises:
        ValueError: two neighbouring fillets overlap, or one is longer than its side.
    """
    arcs: list[list[tuple[float, float]]] = []
    for before, (u, v, radius), after in zip(chain, chain[1:], chain[2:], strict=False):
        arc = fillet_points(before[:2], (u, v), after[:2], radius)
        if arcs:
            end, start = arcs[-1][-1], arc[0]
            along = (start[0] - end[0]) * (u - before[0]) + (start[1] - end[1]) * (v - before[1])
            if along < -1e-9:
                raise ValueError(
                    f"the fillets at {before[:2]} and {(u, v)} overlap: make one radius smaller"
                )
        arcs.append(arc)
    return arcs


def rounded(corners: Sequence[tuple[float, float, float]]) -> Outline:
    """Return the polygon of ``corners`` (u, v, fillet radius), counter-clockwise, mm."""
    arcs = filleted([corners[-1], *corners, corners[0], corners[1]])[:-1]
    return on_grid(np.array([point for arc in arcs for point in arc]))


def rectangle(u: tuple[float, float], v: tuple[float, float], radius: float = 0.0) -> Outline:
    """Return the rectangle over the ranges ``u`` and ``v`` with corners of ``radius``, mm."""
    (a, b), (c, d) = u, v
    return rounded([(a, c, radius), (b, c, radius), (b, d, radius), (a, d, radius)])


def octagon(across_flats: float, radius: float = 0.0) -> Outline:
    """Return a regular octagon about the origin with flats on the axes, mm."""
    reach = across_flats / 2.0 / math.cos(math.pi / 8.0)
    angles = [math.pi / 8.0 + k * math.pi / 4.0 for k in range(8)]
    return rounded([(reach * math.cos(a), reach * math.sin(a), radius) for a in angles])


def toothed(
    radius: float,
    teeth: Sequence[tuple[float, float]],
    count: int,
    at: tuple[float, float] = (0.0, 0.0),
) -> Outline:
    """Return a circle of ``radius`` with ``count`` equal teeth.

    ``teeth``: the corners of one tooth, each (fraction of the pitch, depth below ``radius``).
    """
    step = 2.0 * math.pi / count
    points = [
        (
            at[0] + (radius - depth) * math.cos((k + fraction) * step),
            at[1] + (radius - depth) * math.sin((k + fraction) * step),
        )
        for k in range(count)
        for fraction, depth in teeth
    ]
    return on_grid(np.array(points))


def hull(*outlines: Outline) -> Outline:
    """Return the convex hull of several outlines."""
    section = CrossSection.hull_points(np.vstack(outlines))
    return on_grid(np.asarray(section.to_polygons()[0], dtype=np.float64))


def inset(outline: Outline, distance: float) -> Outline:
    """Return ``outline`` with every side moved inwards by ``distance`` mm, point for point.

    Raises:
        ValueError: a side would vanish or reverse, because ``distance`` exceeds a corner's radius.
    """
    side = np.roll(outline, -1, axis=0) - outline
    length = np.sqrt(side[:, 0] ** 2 + side[:, 1] ** 2)
    inward = np.column_stack((-side[:, 1], side[:, 0])) / length[:, None]
    previous = np.roll(inward, 1, axis=0)
    fraction = 1.0 + previous[:, 0] * inward[:, 0] + previous[:, 1] * inward[:, 1]
    moved = outline + distance * (inward + previous) / fraction[:, None]
    kept = np.roll(moved, -1, axis=0) - moved
    if float((kept * side).sum(axis=1).min()) <= 0.0:
        raise ValueError(
            f"an edge of {distance:g} mm does not fit this outline: give its corners a larger "
            "radius or the edge a smaller one"
        )
    return on_grid(moved)
