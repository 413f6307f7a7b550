"""The pads of the fingers, 16 by 8 taxels along the inner surface of each, and their pressure.

A pad is an elastic foundation, a bed of springs that do not know each other. At each point p = k *
depth with k = E / h, for a layer with the modulus E and the thickness h on a rigid finger (Johnson,
Contact Mechanics, 1985, section 4.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray, frozen

ROWS, COLUMNS = 16, 8
"""Number of taxels along a finger, from the palm to the tip, and across it."""

SAMPLES = (8, 4)
"""Number of points along and across each taxel. With them the force of a cylinder that presses
0.5 mm into a pad of 30 by 16 mm is exact to 0.3 %, and that of a box edge to 1.5 %."""

WIDTH = 19.2e-3
"""[m] Width of a pad of the Katana450: that of its fingers without the rounded edges."""

NEAR = ((17.73e-3, 17.48e-3), (48.0e-3, 38.6e-3))
FAR = (
    (48.0e-3, 38.6e-3),
    (58.78e-3, 32.42e-3),
    (61.33e-3, 31.33e-3),
    (64.37e-3, 31.13e-3),
    (67.05e-3, 31.86e-3),
    (82.05e-3, 38.8e-3),
)
"""[m] Inner surface of the right finger of the Katana450 in the x-y plane of its link, read from
its mesh: the face next to the palm, and that from the bend to the tip. The left finger mirrors it.
Each face has half of the rows, as it has one of the two force sensors."""

SIDES: Mapping[str, float] = {"finger_right_link": 1.0, "finger_left_link": -1.0}
"""Sign of y for each finger of the Katana450, by the name of its link."""

MODULUS = 100e3
"""[Pa] Young's modulus E of the pads: that of a soft foam rubber. Assumed."""

THICKNESS = 5e-3
"""[m] Thickness h of the pads, which is also the greatest depth. Assumed."""

STIFFNESS = MODULUS / THICKNESS
"""[Pa/m] Pressure for each metre of depth."""


@dataclass(frozen=True, eq=False)
class Pad:
    """The elastic surface of one finger as points, in the frame of the link of the finger.

    Attributes:
        finger: name of the link.
        points: (n, 3) [m].
        normals: (n, 3) unit normals, out of the finger.
        areas: (n,) area of each point [m^2].
        taxels: (n,) number of the taxel of each point, row by row.
        places: (n, 2) distance along the surface from the end at the palm, and across it from the
            middle [m].
        length, width: of the surface [m].
    """

    finger: str
    points: FloatArray
    normals: FloatArray
    areas: FloatArray
    taxels: npt.NDArray[np.int64]
    places: FloatArray
    length: float
    width: float

    @cached_property
    def taxel_areas(self) -> FloatArray:
        """(16, 8) area of each taxel [m^2]."""
        return self.summed(self.areas)

    @cached_property
    def middles(self) -> FloatArray:
        """(16, 8, 3) middle of each taxel in the frame of the link [m]."""
        sums = [self.summed(self.areas * coordinate) for coordinate in self.points.T]
        return np.stack(sums, axis=-1) / self.taxel_areas[..., None]

    def summed(self, values: FloatArray) -> FloatArray:
        """Return the sum (16, 8) of the ``values`` (n,) in each taxel."""
        sums = np.bincount(self.taxels, weights=values, minlength=ROWS * COLUMNS)
        return np.asarray(sums.reshape(ROWS, COLUMNS), dtype=np.float64)


def surface_pad(
    finger: str, faces: tuple[npt.ArrayLike, ...], width: float, side: float = 1.0
) -> Pad:
    """Return the pad along ``faces``, each a polyline (k, 2) in the x-y plane of the link [m].

    Each face has the same number of rows. The normals point to the right of the lines, or with
    ``side`` -1, for a finger whose y is mirrored, to the left.
    """
    along, across = SAMPLES
    rows = ROWS // len(faces)
    z_step = width / (COLUMNS * across)
    z = (np.arange(COLUMNS * across) + 0.5) * z_step - 0.5 * width
    column = np.arange(COLUMNS * across) // across
    points, normals, areas, taxels, places = [], [], [], [], []
    begin = 0.0
    for number, face in enumerate(faces):
        corners = np.asarray(face, dtype=np.float64)
        steps = np.diff(corners, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        ends = np.append(0.0, np.cumsum(lengths))
        count = rows * along
        s = (np.arange(count) + 0.5) * ends[-1] / count
        leg = np.searchsorted(ends, s, side="right") - 1
        x, y = (corners[leg] + ((s - ends[leg]) / lengths[leg])[:, None] * steps[leg]).T
        tx, ty = (steps[leg] / lengths[leg, None]).T
        row = number * rows + np.arange(count) // along
        grid = np.ones((count, len(z)))
        points.append(np.stack((x[:, None] * grid, side * y[:, None] * grid, z * grid), axis=-1))
        right = np.stack((ty[:, None] * grid, -side * tx[:, None] * grid, 0.0 * grid), axis=-1)
        normals.append(right)
        areas.append(np.full(grid.shape, ends[-1] / count * z_step))
        taxels.append(COLUMNS * row[:, None] + column)
        places.append(np.stack(((begin + s)[:, None] * grid, z * grid), axis=-1))
        begin += ends[-1]
    return Pad(
        finger,
        frozen(np.concatenate([array.reshape(-1, 3) for array in points])),
        frozen(np.concatenate([array.reshape(-1, 3) for array in normals])),
        frozen(np.concatenate([array.ravel() for array in areas])),
        np.concatenate([array.ravel() for array in taxels]),
        frozen(np.concatenate([array.reshape(-1, 2) for array in places])),
        begin,
        width,
    )


def pads_of(fingers: tuple[str, ...]) -> tuple[Pad, ...]:
    """Return the pads of the right and the left finger; empty if they are not of a Katana450."""
    if set(fingers) != set(SIDES):
        return ()
    return tuple(surface_pad(name, (NEAR, FAR), WIDTH, side) for name, side in SIDES.items())


@dataclass(frozen=True, eq=False)
class PadPressure:
    """The pressure on one pad.

    Attributes:
        finger: name of the link.
        force: integral of the pressure over the surface [N].
        pressure: (16, 8) mean pressure of each taxel [Pa].
        centre: centre of pressure: distance along the pad from the palm, and across it from the
            middle [m]; None without a force.
    """

    finger: str
    force: float
    pressure: FloatArray
    centre: tuple[float, float] | None


def pressed(
    pad: Pad, depth: FloatArray, numbers: npt.NDArray[np.intp] | None = None
) -> PadPressure:
    """Return the pressure on ``pad`` whose points are ``depth`` (n,) [m] inside a body.

    ``numbers``: (n,) the points to which the depths belong, if the others are not pressed.
    """
    selection = slice(None) if numbers is None else numbers
    forces = pressure_at(depth) * pad.areas[selection]
    force = float(forces.sum())
    taxels = np.bincount(pad.taxels[selection], weights=forces, minlength=ROWS * COLUMNS)
    taxels = taxels.reshape(ROWS, COLUMNS)
    centre = None
    if force > 0.0:
        along, across = (forces @ pad.places[selection] / force).tolist()
        centre = (along, across)
    return PadPressure(
        pad.finger,
        force,
        frozen(taxels / pad.taxel_areas),
        centre,
    )


def pressure_at(depth: FloatArray) -> FloatArray:
    """Return the pressure [Pa] at points that are ``depth`` [m] inside a body."""
    return STIFFNESS * np.clip(depth, 0.0, THICKNESS)
