"""Colours of the room round the arm, in a light and a dark theme."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.arm.control.solid import Colour


@dataclass(frozen=True)
class Theme:
    """The look of the room.

    Attributes:
        floor: colour of the floor.
        cell: colour of the fine grid lines.
        section: colour of the coarse grid lines.
        sky: colour of the sky at the top.
        shadow: opacity of shadows on the floor (0 to 1).
        dark: whether the panel is dark.
    """

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
    """Return the sky as an image (128, 2, 3) with a gradient from ``top`` to ``bottom``."""
    rows: npt.NDArray[np.uint8] = np.linspace(top, bottom, 128).round().astype(np.uint8)
    return np.repeat(rows[:, None, :], 2, axis=1)
