"""A script out of postures that a person showed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.maths.geometry.arrays import FloatArray

DIGITS = 3
"""Of the degrees that are written: a tenth of what the arm can tell apart."""


def script_from_postures(name: str, postures: Sequence[FloatArray]) -> str:
    """The text of a script through `postures` (5,) [rad], one after another."""
    steps = "\n".join(
        "  - joints: [" + ", ".join(f"{angle + 0.0:g}" for angle in rounded.tolist()) + "]"
        for rounded in (np.round(np.degrees(q), DIGITS) for q in postures)
    )
    return f'name: "{name}"\nsteps:\n{steps}\n'
