"""Water as meshes: triangles with their corners in m, counterclockwise seen from outside.

The faces are the same for every shape of a kind, so only corners change while water moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.flow import WaterSurface
from katana450.maths.water.parcel import Parcel
from katana450.maths.water.units import FEMTOLITRE, GRAVITY

Faces = npt.NDArray[np.uint32]

COLOUR = (74, 148, 192)
"""Red, green and blue (0 to 255, sRGB) in which water is drawn."""

RUNGS = 20
"""Number of steps from the lowest to the highest side of the water in a cup."""

SECTIONS, SIDES = 20, 8
"""Number of sections and sides of the stream."""

MAX_STREAM_RADIUS = 0.3
"""Maximum radius of the stream at the lip, in cup radii: there it is slow."""

SPOKES = 40
"""Number of spokes of a disc."""

ROUND = 1e-9
"""Cosine of a tilt below which the surface is drawn along the axis."""


def body(cylinder: Cylinder, surface: WaterSurface) -> FloatArray:
    """Return corners (2 (4 RUNGS + 2), 3) of the water in a cylinder that stands on z = 0.

    Wall, underside and upper side have corners of their own, so that only the wall is shaded
    smoothly. The corners lie like the rungs of a ladder from the lowest side to the highest. One
    rung is where the plane meets floor or rim, so the shape is right for every tilt.
    """
    low, high = sorted(cylinder.arcs(surface.tilt, surface.level))
    first = min(max(round(RUNGS * low / high), 1), RUNGS - 1) if high > 0.0 else 1
    psi = (low / first) * np.minimum(_STEPS, first)
    psi += ((high - low) / (RUNGS - first)) * np.maximum(_STEPS - first, 0)
    near, aside = cylinder.radius * np.cos(psi), cylinder.radius * np.sin(psi)
    cosine = math.cos(surface.tilt)
    cosine = math.copysign(max(abs(cosine), ROUND), cosine)
    cut = (surface.level + math.sin(surface.tilt) * near) / cosine
    cut = np.minimum(np.maximum(cut, 0.0), cylinder.depth)
    if low > 0.0:
        # These columns are wet from floor to rim. They are chosen by number: with the plane along
        # the axis all other columns coincide with the last of these and have no area.
        cut[: first + 1] = cylinder.depth if cosine > 0.0 else 0.0
    x, y, _ = surface.downhill
    # The wall, then a copy for underside and upper side; bottom and top of each.
    corners = np.empty((2, 2, 2 * RUNGS + 1, 3))
    for side, columns in ((-aside[::-1], slice(0, RUNGS + 1)), (aside, slice(RUNGS, None))):
        forward = near if columns.start else near[::-1]
        height = cut if columns.start else cut[::-1]
        corners[:, :, columns, 0] = forward * x - side * y
        corners[:, :, columns, 1] = forward * y + side * x
        corners[:, 0, columns, 2] = 0.0 if cosine > 0.0 else height
        corners[:, 1, columns, 2] = height if cosine > 0.0 else cylinder.depth
    return corners.reshape(-1, 3)


_STEPS = np.arange(RUNGS + 1)


def _ladder() -> Faces:
    """Return the faces of `body`."""
    columns = 2 * RUNGS + 1
    a = np.arange(columns - 1)
    wall = [(a, a + 1, a + 1 + columns), (a, a + 1 + columns, a + columns)]
    k = np.arange(RUNGS)
    right, left = RUNGS + k, RUNGS - k
    side = [(left, right, right + 1), (left, right + 1, left - 1)]
    under = [tuple(reversed([corner + 2 * columns for corner in three])) for three in side]
    over = [tuple(corner + 3 * columns for corner in three) for three in side]
    return _stacked([*wall, *under, *over])


def stream(parcels: Sequence[Parcel], radius: float, end: float) -> FloatArray:
    """Return corners (SECTIONS SIDES, 3) of the flying water in the base frame.

    ``parcels`` are one or more. The stream is a tube along the present places of water of every
    age, as wide as its flow at its speed requires. It is closed at its ends, and of zero width
    where no water flies. ``radius`` is that of the cup, ``end`` the age [s] at which the oldest
    parcel lands.
    """
    left = np.array(
        [(p.age, p.span, p.volume * FEMTOLITRE / p.span, *p.start, *p.velocity) for p in parcels]
    )[::-1]
    ages = left[:, 0]
    last = max(min(float(ages[-1] + left[-1, 1]), end), float(ages[-1]))
    age = ages[0] + (last - ages[0]) * _SPOTS
    behind = np.maximum(np.searchsorted(ages, age, side="right") - 1, 0)
    before = np.minimum(behind + 1, len(ages) - 1)
    between = np.maximum(ages[before] - ages[behind], AGE_ROUNDING)
    fraction = np.minimum((age - ages[behind]) / between, 1.0)
    centre = left[behind] + fraction[:, None] * (left[before] - left[behind])
    p, v, fall = centre[:, 3:6], centre[:, 6:9], GRAVITY * age
    p += v * age[:, None]
    p[:, 2] -= 0.5 * fall * age
    v[:, 2] -= fall

    speed = np.maximum(np.sqrt((v * v).sum(axis=1)), MIN_STREAM_SPEED)
    jet = np.minimum(np.sqrt(centre[:, 2] / (math.pi * speed)), MAX_STREAM_RADIUS * radius)
    jet[age > ages[behind] + left[behind, 1] + AGE_ROUNDING] = 0.0
    jet[0] = jet[-1] = 0.0

    level = v[:, :2].sum(axis=0).tolist()
    long = math.hypot(*level)
    across = np.array((-level[1], level[0], 0.0)) / long if long > 0.0 else _X
    # Perpendicular to both; ``across`` is level.
    under = v[:, (2, 2, 1)] * (across[1], -across[0], across[0])
    under[:, 2] -= across[1] * v[:, 0]
    under /= speed[:, None]
    aside, down = jet[:, None] * _ROUND_COS, jet[:, None] * _ROUND_SIN
    corners = p[:, None] + aside[..., None] * across + down[..., None] * under[:, None]
    return np.asarray(corners.reshape(-1, 3))


MIN_STREAM_SPEED = 0.02
"""Minimum speed of the stream [m/s]."""

AGE_ROUNDING = 1e-6
"""Rounding of ages [s]."""


_SPOTS = np.clip(np.arange(-1, SECTIONS - 1) / (SECTIONS - 3.0), 0.0, 1.0)
"""Places along the stream as fractions of its duration; both ends twice, to close it."""

_X = np.array((1.0, 0.0, 0.0))
_TURN = np.arange(SIDES) * (math.tau / SIDES)
_ROUND_COS, _ROUND_SIN = np.cos(_TURN), np.sin(_TURN)


def _tube() -> Faces:
    """Return the faces of `stream`."""
    a = np.arange(SIDES)
    b = (a + 1) % SIDES
    quads = []
    for row in range(SECTIONS - 1):
        near, far = row * SIDES, (row + 1) * SIDES
        quads += [(a + near, a + far, b + far), (a + near, b + far, b + near)]
    return _stacked(quads)


def disc() -> tuple[FloatArray, Faces]:
    """Return corners and faces of a level disc of radius 1 about z, at z = 1.

    Its scale alone therefore gives its width and its height.
    """
    turn = np.arange(SPOKES) * (math.tau / SPOKES)
    rim = np.stack((np.cos(turn), np.sin(turn), np.ones(SPOKES)), axis=1)
    k = np.arange(SPOKES)
    fan = (np.zeros_like(k), 1 + k, 1 + (k + 1) % SPOKES)
    return np.concatenate(([[0.0, 0.0, 1.0]], rim)), _stacked([fan])


def _stacked(threes: Sequence[Sequence[npt.NDArray[np.intp]]]) -> Faces:
    """Return triangles from rows of corner numbers."""
    return np.concatenate([np.stack(three, axis=1) for three in threes]).astype(np.uint32)


BODY_FACES = _ladder()
STREAM_FACES = _tube()
