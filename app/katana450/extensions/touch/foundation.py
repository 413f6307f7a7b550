"""Pressure on an elastic pad: an elastic foundation, a bed of springs that do not know each other.

At each point p = k * depth with k = E / h, for a layer with the modulus E and the thickness h on a
rigid finger (Johnson, Contact Mechanics, 1985, section 4.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.extensions.touch.pad import COLUMNS, ROWS, Pad
from katana450.maths.geometry.arrays import FloatArray, frozen

MODULUS = 100e3
"""[Pa] Young's modulus E of the pads: that of a soft foam rubber. Assumed."""

THICKNESS = 5e-3
"""[m] Thickness h of the pads, which is also the greatest depth. Assumed."""

STIFFNESS = MODULUS / THICKNESS
"""[Pa/m] Pressure for each metre of depth."""


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
    at = slice(None) if numbers is None else numbers
    forces = pressure_at(depth) * pad.areas[at]
    force = float(forces.sum())
    taxels = np.bincount(pad.taxels[at], weights=forces, minlength=ROWS * COLUMNS)
    taxels = taxels.reshape(ROWS, COLUMNS)
    centre = None
    if force > 0.0:
        along, across = (forces @ pad.places[at] / force).tolist()
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
