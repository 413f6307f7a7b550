"""A camera without a lens: the rays through the pixels of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from katana450.errors import InputError
from katana450.extensions.media.scene import Floats, unit
from katana450.maths.geometry.arrays import finite_array


@dataclass(frozen=True)
class Camera:
    """position, target: [m] in the base frame, z up. fov: between top and bottom [rad].

    size: width and height of its picture in pixels.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float
    size: tuple[int, int]

    def __post_init__(self) -> None:
        eye = finite_array(self.position, (3,), "The position of the camera")
        to = finite_array(self.target, (3,), "The target of the camera") - eye
        if math.hypot(to[0], to[1]) < MIN_SLOPE_SINE * float(np.linalg.norm(to)) or not to.any():
            raise InputError("The camera would look straight up or down, or at itself.")
        if not 0.0 < self.fov < math.pi:
            raise InputError(f"The camera's field of view is {self.fov} rad; give 0 to pi.")
        if not all(1 <= side <= MAX_PIXELS for side in self.size):
            raise InputError(f"A picture has 1 to {MAX_PIXELS} pixels a side, not {self.size}.")

    @cached_property
    def frame(self) -> Floats:
        """(3, 3) whose rows are its right, its up and where it looks."""
        ahead = unit(np.subtract(self.target, self.position))
        right = unit(np.cross(ahead, (0.0, 0.0, 1.0)))
        return np.stack((right, np.cross(right, ahead), ahead)).astype(np.float32)

    @property
    def pixel(self) -> float:
        """What a pixel in the middle is across, as a fraction of the distance."""
        return 2.0 * math.tan(0.5 * self.fov) / self.size[1]

    def directions(self, x: Floats, y: Floats) -> Floats:
        """(n, 3) through the spots x, y (n,) of the picture: pixels from its top left corner."""
        width, height = self.size
        across = (x - 0.5 * width) * self.pixel
        up = (0.5 * height - y) * self.pixel
        return unit(np.stack((across, up, np.ones_like(across)), axis=1) @ self.frame)


MIN_SLOPE_SINE = 1e-3
"""Sine of the least angle from straight up or down."""

MAX_PIXELS = 8192
