"""Named cameras of the scene, and the one that a browser begins with."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

FOV = np.deg2rad(40.0)
"""[rad] Vertical; that of a lens which does not bend the arm."""


@dataclass(frozen=True)
class CameraPose:
    """A camera at ``position``, turned to ``target``; both [m] in the base frame."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]


class Preset(Enum):
    """The views a person can ask for; only the last one follows the arm."""

    FREE = "3D"
    FRONT = "Front"
    SIDE = "Side"
    TOP = "Top"
    TOOL = "Tool"


CAMERA_POSES = {
    Preset.FREE: CameraPose((0.77, -1.33, 0.97), (0.0, 0.0, 0.35)),
    Preset.FRONT: CameraPose((1.64, 0.0, 0.46), (0.0, 0.0, 0.36)),
    Preset.SIDE: CameraPose((0.0, -1.64, 0.46), (0.0, 0.0, 0.36)),
    # Not from straight above: a camera that looks along up has no up.
    Preset.TOP: CameraPose((0.0, -0.01, 2.16), (0.0, 0.0, 0.2)),
}
"""As near as all of the arm is in the picture, however it is posed; cup and basin in the first."""
