"""A pinhole camera: the rays through the pixels of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.media.scene import Floats, unit
from katana450.maths.geometry.arrays import finite_array


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        position: [m] in the base frame, z up.
        target: point that it looks at [m].
        fov: vertical field of view [rad].
        size: width and height of its picture [px].

    Raises InputError for invalid values.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float
    size: tuple[int, int]

    def __post_init__(self) -> None:
        eye = finite_array(self.position, (3,), "The position of the camera")
        to = finite_array(self.target, (3,), "The target of the camera") - eye
        if math.hypot(to[0], to[1]) < MIN_SLOPE_SINE * float(np.linalg.norm(to)) or not to.any():
            raise InputError(
                "The camera must not look straight up or down, or at its own position."
            )
        if not 0.0 < self.fov < math.pi:
            raise InputError(
                f"The camera's field of view is {self.fov} rad; it must be between 0 and pi."
            )
        if not all(1 <= side <= MAX_PIXELS for side in self.size):
            raise InputError(
                f"A picture must have 1 to {MAX_PIXELS} pixels per side, not {self.size}."
            )

    @cached_property
    def frame(self) -> Floats:
        """The rows (3, 3) of its axes in the base frame: right, up and ahead."""
        ahead = unit(np.subtract(self.target, self.position))
        right = unit(np.cross(ahead, (0.0, 0.0, 1.0)))
        return np.stack((right, np.cross(right, ahead), ahead)).astype(np.float32)

    @property
    def pixel(self) -> float:
        """The width of the central pixel, as a fraction of the distance."""
        return 2.0 * math.tan(0.5 * self.fov) / self.size[1]

    def directions(self, x: Floats, y: Floats) -> Floats:
        """Return unit directions (n, 3) through x, y (n,) [px] from the top left corner."""
        width, height = self.size
        across = (x - 0.5 * width) * self.pixel
        up = (0.5 * height - y) * self.pixel
        return unit(np.stack((across, up, np.ones_like(across)), axis=1) @ self.frame)


MIN_SLOPE_SINE = 1e-3
"""Sine of the minimum angle between view direction and vertical."""

MAX_PIXELS = 8192
"""Maximum width and height of a picture."""
