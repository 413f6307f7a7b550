"""The fractions of the key light and of the sky light that reach each visible point.

Each pixel traces a few rays, with other directions in each of the sixteen pixels of a tile. The
mean over as many pixels of one surface (Keller and Heidrich, Interleaved Sampling, 2001) gives the
quality of many rays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.extensions.media.hits import NOWHERE, Hits
from katana450.extensions.media.scene import Floats, unit
from katana450.extensions.media.tracer import Tracer

TILE = np.array(((0, 8, 2, 10), (12, 4, 14, 6), (3, 11, 1, 9), (15, 7, 13, 5)))
"""Number of the sample set of each pixel in a tile; neighbours have distant numbers."""

KEY_SIZE = 0.045
"""[rad] Apparent radius of the key light, which determines the softness of shadows."""

MAX_SHADOW_LENGTH = 2.5
"""[m] Maximum length of a shadow."""

SKY_RANGE = 0.3
"""[m] Maximum distance of surfaces that hide the sky, because the whole room is bright."""

RAY_OFFSET = 2e-4
"""[m] Distance of the start of a ray from its surface, to avoid hits of the surface itself."""

PLANE_TOLERANCE = 2e-3
"""[m] Maximum distance from one plane of two pixels of one surface."""

SAME_NORMAL_COSINE = 0.9
"""Minimum cosine between normals of two pixels of one surface."""

GOLDEN = 0.618034
"""The golden section [1]."""


class Light(NamedTuple):
    """Fractions (n,) of key light and sky light that reach each point, from 0 to 1."""

    key: Floats
    sky: Floats


def reaching(
    hits: Hits, tracer: Tracer, towards: Floats, size: tuple[int, int], rays: int
) -> Light:
    """Return the light at each pixel of a picture of width and height ``size``, row by row.

    ``towards`` (3,) is the unit direction to the key light. ``rays`` is the number of rays per
    pixel and kind of light.
    """
    width, height = size
    rows, columns = np.divmod(np.arange(width * height), width)
    place = TILE[rows % 4, columns % 4]
    seen = np.flatnonzero(hits.item != NOWHERE)
    faces_key = np.einsum("ni,i->n", hits.flat[seen], towards) > 0.0
    lit = seen[faces_key]
    key, sky = (np.zeros(width * height, dtype=np.float32) for _ in range(2))
    disc, dome = _disc(rays), _dome(rays)
    side, upright = _across(hits.normals[seen])
    aside, above = _across(towards[None])
    for ray in range(rays):
        number = place + 16 * ray
        spot = disc[number[lit]]
        key[lit] += ~tracer.blocked(
            _start(hits, lit),
            unit(towards + spot[:, :1] * aside + spot[:, 1:] * above),
            MAX_SHADOW_LENGTH,
        )
        local = dome[number[seen]]
        out = local[:, :1] * side + local[:, 1:2] * upright + local[:, 2:] * hits.normals[seen]
        sky[seen] += ~tracer.blocked(_start(hits, seen), out.astype(np.float32), SKY_RANGE)
    found = np.stack((key, sky), axis=-1).reshape(height, width, 2) / np.float32(rays)
    points = hits.points.reshape(height, width, 3)
    normals = hits.normals.reshape(height, width, 3)
    for axis in (0, 1):
        found = _spread(found, points, normals, axis, 1)
    # The shade of the sky has no edges, so a wider mean is possible.
    soft = found[..., 1:]
    for axis in (0, 1):
        soft = _spread(soft, points, normals, axis, 3)
    return Light(found[..., 0].ravel(), soft.ravel())


def _start(hits: Hits, which: np.typing.NDArray[np.intp]) -> Floats:
    return (hits.points[which] + RAY_OFFSET * hits.flat[which]).astype(np.float32)


def _spread(values: Floats, points: Floats, normals: Floats, axis: int, stride: int) -> Floats:
    """Return means over four pixels along one axis, ``stride`` apart, on the same surface.

    Every place of a tile counts once: of five pixels, the outer two have half weight.
    """
    total, weights = values.copy(), np.ones(values.shape[:2], dtype=np.float32)
    for step, weight in ((stride, 1.0), (2 * stride, 0.5)):
        here, there = [slice(None)] * 2, [slice(None)] * 2
        here[axis], there[axis] = slice(None, -step), slice(step, None)
        one, other = tuple(here), tuple(there)
        apart = points[other] - points[one]
        same = np.abs(np.einsum("hwi,hwi->hw", apart, normals[one])) < PLANE_TOLERANCE
        same &= np.abs(np.einsum("hwi,hwi->hw", apart, normals[other])) < PLANE_TOLERANCE
        same &= np.einsum("hwi,hwi->hw", normals[one], normals[other]) > SAME_NORMAL_COSINE
        fraction = weight * same.astype(np.float32)
        total[one] += fraction[..., None] * values[other]
        total[other] += fraction[..., None] * values[one]
        weights[one] += fraction
        weights[other] += fraction
    return total / weights[..., None]


def _spots(rays: int) -> Floats:
    """Return points (16 rays, 2), evenly in the unit square; the first 16 are for the first ray.

    The points of one place are far apart too: the first coordinate by strata, the second by the
    golden section, starting from Van der Corput's sequence.
    """
    place = np.arange(16)
    mirrored = ((place & 1) * 8 + (place & 2) * 2 + (place & 4) // 2 + (place & 8) // 8) / 16.0
    ray = np.arange(rays)[:, None]
    first = (ray + (place + 0.5) / 16.0) / rays
    second = (mirrored + 0.5 / 16.0 + ray * GOLDEN) % 1.0
    return np.stack((first, second), axis=2).reshape(-1, 2).astype(np.float32)


def _disc(rays: int) -> Floats:
    """Return points (16 rays, 2), evenly on the disc of the key light."""
    spots = _spots(rays)
    r, turn = KEY_SIZE * np.sqrt(spots[:, 0]), 2.0 * np.pi * spots[:, 1]
    return np.stack((r * np.cos(turn), r * np.sin(turn)), axis=1).astype(np.float32)


def _dome(rays: int) -> Floats:
    """Return directions (16 rays, 3) over the half sphere about z, weighted by Lambert's cosine."""
    spots = _spots(rays)
    r, turn = np.sqrt(spots[:, 0]), 2.0 * np.pi * spots[:, 1]
    up = np.sqrt(1.0 - spots[:, 0])
    return np.stack((r * np.cos(turn), r * np.sin(turn), up), axis=1).astype(np.float32)


def _across(n: Floats) -> tuple[Floats, Floats]:
    """Return two sets of unit vectors (n, 3), orthogonal to ``n`` (n, 3) and to each other.

    Source: Duff et al., Building an Orthonormal Basis, Revisited, 2017.
    """
    x, y, z = n.T
    sign = np.where(z < 0.0, np.float32(-1.0), np.float32(1.0))
    a = -1.0 / (sign + z)
    b = x * y * a
    one = np.stack((1.0 + sign * x * x * a, sign * b, -sign * x), axis=1)
    return one, np.stack((b, sign + y * y * a, -y), axis=1)
