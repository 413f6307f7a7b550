"""Water as meshes: triangles with their corners in m, wound to be seen from outside.

Faces are the same for every shape of a kind, so that only corners change while water moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.water.cylinder import Cylinder
from app.water.flow import Surface
from app.water.parcel import Parcel
from app.water.puddle import THICKNESS
from app.water.units import FEMTOLITRE, GRAVITY

Faces = npt.NDArray[np.uint32]

RUNGS = 20
"""Steps from the lowest to the highest side of the water in a cup."""

SECTIONS, SIDES = 26, 8
"""Of the stream."""

THICKEST = 0.3
"""[cup radius] The stream at the lip: there it is slow, and a sheet rather than a jet."""

SHEET, GATHERED = 1.6, 0.03
"""How much wider than a jet the sheet is at the lip, less 1; and on what way [m] it gathers."""

SPOKES = 40
"""Of a disc."""

DOME = ((0.55, 1.0), (0.82, 0.94), (0.95, 0.62), (1.0, 0.0))
"""(out, up) from the middle of a puddle to its edge, of radius and thickness."""

ROUND = 1e-9
"""Cosine of a tilt nearer to 0 than which the surface is drawn along the axis."""


def body(cylinder: Cylinder, surface: Surface) -> FloatArray:
    """Corners (2 (4 RUNGS + 2), 3) of the water in a cylinder that stands on z = 0.

    Wall, underside and upper side, each with corners of its own so that only the wall is shaded
    round. They are laid as the rungs of a ladder are from the lowest side to the highest, one of
    them where the plane meets floor or rim: so the shape is right for every tilt.
    """
    low, high = sorted(cylinder.arcs(surface.tilt, surface.level))
    first = min(max(round(RUNGS * low / high), 1), RUNGS - 1) if high > 0.0 else 1
    half = np.concatenate(
        (np.linspace(0.0, low, first, endpoint=False), np.linspace(low, high, RUNGS + 1 - first))
    )
    psi = np.concatenate((-half[:0:-1], half))
    cosine = math.cos(surface.tilt)
    cosine = math.copysign(max(abs(cosine), ROUND), cosine)
    rise = surface.level + cylinder.radius * math.sin(surface.tilt) * np.cos(psi)
    cut = np.clip(rise / cosine, 0.0, cylinder.depth)
    # Wet from floor to rim; told by number, because with the plane along the axis all the other
    # columns stand where the last of these does, and are nothing.
    whole = (np.abs(np.arange(len(psi)) - RUNGS) <= first) & (low > 0.0)
    if cosine > 0.0:
        bottom, top = np.zeros_like(cut), np.where(whole, cylinder.depth, cut)
    else:
        bottom, top = np.where(whole, 0.0, cut), np.full_like(cut, cylinder.depth)
    x, y, _ = surface.downhill
    out = cylinder.radius * np.stack(
        (np.cos(psi) * x - np.sin(psi) * y, np.cos(psi) * y + np.sin(psi) * x), axis=1
    )
    lower, upper = np.column_stack((out, bottom)), np.column_stack((out, top))
    return np.concatenate((lower, upper, lower, upper))


def _ladder() -> Faces:
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
    """Corners (SECTIONS SIDES, 3) of the water that flies, in the base frame; parcels: at least 1.

    A tube along where water of every age is now, as wide as what left then is at its speed; closed
    at its ends, and drawn to a thread where nothing flies. radius: of the cup. end: the age [s] at
    which the oldest parcel comes down.
    """
    newest = parcels[::-1]
    ages = np.array([parcel.age for parcel in newest])
    spans = np.array([parcel.span for parcel in newest])
    volumes = np.array([parcel.volume for parcel in newest]) * FEMTOLITRE
    starts = np.array([parcel.start for parcel in newest])
    velocities = np.array([parcel.velocity for parcel in newest])
    last = min(float(ages[-1] + spans[-1]), end)
    age = np.linspace(ages[0], max(last, float(ages[-1])), SECTIONS - 2)
    age = np.concatenate((age[:1], age, age[-1:]))
    p = np.stack([np.interp(age, ages, starts[:, k]) for k in range(3)], axis=1)
    v = np.stack([np.interp(age, ages, velocities[:, k]) for k in range(3)], axis=1)
    p += v * age[:, None]
    p[:, 2] -= 0.5 * GRAVITY * age**2
    v[:, 2] -= GRAVITY * age

    speed = np.maximum(np.linalg.norm(v, axis=1), SLOWEST)
    jet = np.sqrt(np.interp(age, ages, volumes / spans) / (math.pi * speed))
    jet = np.minimum(jet, THICKEST * radius)
    behind = np.maximum(np.searchsorted(ages, age, side="right") - 1, 0)
    jet[age > ages[behind] + spans[behind] + MOMENT] = 0.0
    jet[0] = jet[-1] = 0.0

    level = v[:, :2].sum(axis=0)
    long = math.hypot(*level)
    across = np.array((-level[1], level[0], 0.0)) / long if long > 0.0 else np.array((1.0, 0, 0))
    along = v / speed[:, None]
    thick = np.cross(across, along)
    fallen = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))))
    wide = jet * (1.0 + SHEET * np.exp(-fallen / GATHERED))
    thin = np.divide(jet * jet, wide, out=np.zeros_like(jet), where=wide > 0.0)
    turn = np.arange(SIDES) * (math.tau / SIDES)
    corners = (
        p[:, None]
        + (wide[:, None] * np.cos(turn))[..., None] * across
        + (thin[:, None] * np.sin(turn))[..., None] * thick[:, None]
    )
    return np.asarray(corners.reshape(-1, 3))


SLOWEST = 0.02
"""[m/s]"""

MOMENT = 1e-6
"""[s] Rounding of ages."""


def _tube() -> Faces:
    a = np.arange(SIDES)
    b = (a + 1) % SIDES
    quads = []
    for row in range(SECTIONS - 1):
        here, ahead = row * SIDES, (row + 1) * SIDES
        quads += [(a + here, a + ahead, b + ahead), (a + here, b + ahead, b + here)]
    return _stacked(quads)


def disc() -> tuple[FloatArray, Faces]:
    """Corners and faces of a level disc of radius 1 about z."""
    turn = np.arange(SPOKES) * (math.tau / SPOKES)
    rim = np.stack((np.cos(turn), np.sin(turn), np.zeros(SPOKES)), axis=1)
    k = np.arange(SPOKES)
    fan = (np.zeros_like(k), 1 + k, 1 + (k + 1) % SPOKES)
    return np.concatenate((np.zeros((1, 3)), rim)), _stacked([fan])


def blob() -> tuple[FloatArray, Faces]:
    """Corners and faces of a puddle on z = 0: as large as a disc of radius 1, but not as round."""
    turn = np.arange(SPOKES) * (math.tau / SPOKES)
    edge = 1.0 + 0.07 * np.cos(2 * turn + 1.0) + 0.05 * np.cos(3 * turn + 2.1)
    edge += 0.03 * np.cos(5 * turn)
    edge /= math.sqrt(float(np.mean(edge**2)))
    rings = [
        np.stack(
            (out * edge * np.cos(turn), out * edge * np.sin(turn), np.full(SPOKES, up * THICKNESS)),
            axis=1,
        )
        for out, up in DOME
    ]
    k = np.arange(SPOKES)
    after = (k + 1) % SPOKES
    faces = [(np.zeros_like(k), 1 + k, 1 + after)]
    for row in range(len(DOME) - 1):
        inner, outer = 1 + row * SPOKES, 1 + (row + 1) * SPOKES
        faces += [
            (inner + k, outer + k, outer + after),
            (inner + k, outer + after, inner + after),
        ]
    return np.concatenate((np.array([[0.0, 0.0, THICKNESS]]), *rings)), _stacked(faces)


def _stacked(threes: Sequence[Sequence[npt.NDArray[np.intp]]]) -> Faces:
    return np.concatenate([np.stack(three, axis=1) for three in threes]).astype(np.uint32)


BODY_FACES = _ladder()
STREAM_FACES = _tube()
