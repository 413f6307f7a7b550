"""Scripts from taught postures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.maths.geometry.arrays import FloatArray

DIGITS = 3
"""Decimal places of written angles [deg]: a tenth of the arm's resolution."""


def script_from_postures(name: str, postures: Sequence[FloatArray]) -> str:
    """Return the text of a script through ``postures``, each (5,) [rad], one after another."""
    steps = "\n".join(
        "  - joints: [" + ", ".join(f"{angle + 0.0:g}" for angle in rounded.tolist()) + "]"
        for rounded in (np.round(np.degrees(q), DIGITS) for q in postures)
    )
    return f'name: "{name}"\nsteps:\n{steps}\n'
