"""Colours for fractions, dark for few orientations and light for many, for screen and print."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray

_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
_COLORS = np.array([(52, 16, 90), (46, 79, 148), (22, 138, 134), (106, 192, 82), (250, 230, 60)])


def fraction_colors(fraction: FloatArray) -> npt.NDArray[np.uint8]:
    """Return red, green, blue (N, 3) for ``fraction`` (N,), scaled to its maximum.

    Five axes give a third of all orientations at best, so a scale up to 1 would show little.
    """
    relative = fraction / fraction.max(initial=np.finfo(np.float64).tiny)
    channels = [np.interp(relative, _FRACTIONS, channel) for channel in _COLORS.T]
    colors: npt.NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return colors
