"""Transfer functions of sRGB (IEC 61966-2-1). glTF stores colours as linear light."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def to_srgb(light: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the sRGB values 0..1 of linear light 0..1, of any shape; other values are clipped."""
    light = np.clip(np.nan_to_num(np.asarray(light, dtype=np.float64)), 0.0, 1.0)
    root = 1.055 * np.power(light, 1.0 / 2.4) - 0.055
    return np.where(light <= 0.0031308, 12.92 * light, root)


def to_light(srgb: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the linear light 0..1 of sRGB values 0..1, of any shape."""
    srgb = np.asarray(srgb, dtype=np.float64)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
