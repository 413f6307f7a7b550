"""Nearest points of two convex bodies from their support mappings, and the depth of an overlap.

A support mapping returns the point of a body that is farthest along a direction. The nearest points
are the point of least norm in the difference of the bodies (P. Wolfe, Finding the nearest point in
a polytope, Mathematical Programming 11, 1976). Each step bounds the distance from below, so a
result is known to be exact to EXACT.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from katana450.maths.collision.contact import Witness
from katana450.maths.geometry.arrays import FloatArray, frozen

Support = Callable[[FloatArray], FloatArray]
"""A map from a direction (3,) of any length to the point (3,) farthest along it [m]."""

EXACT = 1e-9
"""Distance from the lower bound [m] at which a search ends."""

STEPS = 300
"""Maximum number of steps of a search. A hull takes fewer than 20; round bodies take the most."""

TOUCHING = 1e-9
"""Bodies nearer than this [m] count as touching."""

ASIDE = 0.01
"""Distance [m] by which overlapping bodies are moved apart beyond their contact to find its normal.
"""

TURNS = 30
"""Number of directions that are tried for an overlap."""

ROUNDING = 1e-13
"""Weights and lengths [1] below this are zero."""


def overlap(one: Support, other: Support, direction: FloatArray) -> float:
    """Return the motion [m] of ``other`` along the unit ``direction`` that leaves ``one``.

    A negative value is a lower bound of the distance between them.
    """
    return float(direction @ (one(direction) - other(-direction)))


def nearest_points(one: Support, other: Support, towards: FloatArray) -> FloatArray | None:
    """Return the nearest points (2, 3) of two bodies [m]; None where they touch or overlap.

    ``towards`` (3,) is a direction from the first to the second, as a start.
    """
    ends = np.array([[one(towards), other(-towards)]])
    weights = np.ones(1)
    for _ in range(STEPS):
        points = np.einsum("i,ijk->jk", weights, ends)
        gap = points[1] - points[0]
        length = float(np.linalg.norm(gap))
        if length < TOUCHING:
            return None
        new = np.array([one(gap), other(-gap)])
        step = new[1] - new[0]
        if length - gap @ step / length <= EXACT or _known(ends, step):
            return np.asarray(points)
        ends, weights = _reduced(np.concatenate((ends, new[None])), np.append(weights, 0.0))
    return np.asarray(np.einsum("i,ijk->jk", weights, ends))


def deepest(one: Support, other: Support, directions: Iterable[FloatArray]) -> Witness:
    """Return the shortest motion out of an overlap, starting with the best unit ``directions``.

    The second body is moved out along the direction found so far. The nearest points there give a
    direction that is at least as short.
    """
    normal = min(directions, key=lambda direction: overlap(one, other, direction))
    depth = overlap(one, other, normal)
    for _ in range(TURNS):
        aside = (max(depth, 0.0) + ASIDE) * normal
        points = nearest_points(one, lambda n, by=aside: other(n) + by, normal)  # type: ignore[misc]
        if points is None:
            break
        gap = points[1] - points[0]
        better = gap / np.linalg.norm(gap)
        shorter = overlap(one, other, better)
        if shorter > depth - EXACT:
            break
        normal, depth = better, shorter
    aside = (max(depth, 0.0) + ASIDE) * normal
    points = nearest_points(one, lambda n: other(n) + aside, normal)
    if points is None:
        points = np.array([one(normal), other(-normal) + aside])
    first = points[0]
    return Witness(-depth, frozen((first, first - depth * normal)), frozen(normal))


def _known(ends: FloatArray, step: FloatArray) -> bool:
    """Return True if ``step`` is already among the differences of ``ends``."""
    differences = ends[:, 1] - ends[:, 0] - step
    return bool((np.abs(differences).max(axis=1) < ROUNDING).any())


def _reduced(ends: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ends and weights of the point of least norm, without ends of zero weight."""
    while True:
        best = _affine_minimum(ends[:, 1] - ends[:, 0])
        negative = best < ROUNDING
        if not negative.any():
            return ends, best
        # Move up to the first weight that becomes zero.
        ratio = weights[negative] / np.maximum(weights[negative] - best[negative], ROUNDING)
        weights = weights + min(float(ratio.min()), 1.0) * (best - weights)
        kept = weights > ROUNDING
        if kept.all():
            kept[int(weights.argmin())] = False
        ends, weights = ends[kept], weights[kept] / weights[kept].sum()


def _affine_minimum(points: FloatArray) -> FloatArray:
    """Return the weights (k,), of sum 1, of the point of least norm in the plane of ``points``."""
    base, sides = points[-1], points[:-1] - points[-1]
    found = np.linalg.lstsq(sides.T, -base, rcond=None)[0]
    return np.append(found, 1.0 - found.sum())
