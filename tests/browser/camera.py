"""The camera of a browser window, and how much the window draws."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from urllib.parse import urlencode


class Drawing(StrEnum):
    """When a window draws; without a graphics card, drawing is most of the work of a browser."""

    PICTURES = "pictures"
    """Only for pictures. Otherwise each frame does all work except the drawing."""
    BEST = "best"
    """Only for pictures, with reflections, shadows, smooth edges and every pixel."""
    ALWAYS = "always"
    NONE = "none"
    """viser does not load, which takes most of the time: the window has our page alone."""


@dataclass(frozen=True)
class Camera:
    """The camera of a browser, in viser's world [m]; `fov` is vertical [rad]."""

    position: tuple[float, float, float] = (0.75, -0.7, 0.65)
    look_at: tuple[float, float, float] = (0.2, 0.0, 0.22)
    fov: float = 0.7

    def query(self, pixels: float) -> str:
        """Return the camera as parameters of the address of viser's page.

        `pixels` is the number of drawn pixels per pixel of the window, along each side.
        """
        values = {
            "initialCameraPosition": ",".join(map(str, self.position)),
            "initialCameraLookAt": ",".join(map(str, self.look_at)),
            "initialCameraFov": str(self.fov),
            # Without this, viser draws fewer pixels on a slow machine.
            "fixedDpr": str(pixels),
        }
        return urlencode(values, safe=",")
