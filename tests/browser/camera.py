"""The camera of a browser window, and how much the window draws."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from urllib.parse import urlencode


class Drawing(StrEnum):
    """When a window draws, which without a graphics card is most of what a browser does."""

    PICTURES = "pictures"
    """For pictures of it alone. Else all but the drawing is done, frame by frame."""
    BEST = "best"
    """Likewise, with reflections, shadows, smooth edges and every pixel."""
    ALWAYS = "always"


@dataclass(frozen=True)
class Camera:
    """Where the browser looks from: viser's world, metres, `fov` vertical in radians."""

    position: tuple[float, float, float] = (0.75, -0.7, 0.65)
    look_at: tuple[float, float, float] = (0.2, 0.0, 0.22)
    fov: float = 0.7

    def query(self, pixels: float) -> str:
        """The camera as viser's page takes it in its address.

        `pixels` are drawn for each of the window's along either side.
        """
        values = {
            "initialCameraPosition": ",".join(map(str, self.position)),
            "initialCameraLookAt": ",".join(map(str, self.look_at)),
            "initialCameraFov": str(self.fov),
            # Else viser draws in fewer pixels whenever the machine is slow.
            "fixedDpr": str(pixels),
        }
        return urlencode(values, safe=",")
