"""Colours of the room round the arm, by day and by night."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.arm.control.solid import Colour


@dataclass(frozen=True)
class Theme:
    """Colours of the room. dark: whether the panel is dark too."""

    floor: Colour
    cell: Colour
    section: Colour
    sky: Colour
    shadow: float
    dark: bool


LIGHT = Theme((226, 231, 236), (207, 213, 220), (178, 187, 197), (247, 249, 251), 0.35, dark=False)
DARK = Theme((38, 42, 48), (50, 55, 62), (70, 77, 87), (22, 24, 28), 0.6, dark=True)

THEMES = {"Light": LIGHT, "Dark": DARK}


def gradient(top: Colour, bottom: Colour) -> npt.NDArray[np.uint8]:
    """The sky as a picture (128, 2, 3): from ``top`` down to ``bottom``."""
    rows: npt.NDArray[np.uint8] = np.linspace(top, bottom, 128).round().astype(np.uint8)
    return np.repeat(rows[:, None, :], 2, axis=1)
