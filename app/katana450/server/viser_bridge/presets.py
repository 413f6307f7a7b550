"""Named cameras of the scene. A browser begins with ``Preset.FREE``."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

FOV = np.deg2rad(40.0)
"""Vertical field of view [rad], small enough that perspective does not distort the arm."""


@dataclass(frozen=True)
class CameraPose:
    """A camera at ``position`` that looks at ``target``, both [m] in the base frame."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]


class Preset(Enum):
    """The views that a person can choose. Only TOOL follows the arm."""

    FREE = "3D"
    FRONT = "Front"
    SIDE = "Side"
    LEFT = "Left"
    BACK = "Back"
    TOP = "Top"
    TOOL = "Tool"


CAMERA_POSES = {
    Preset.FREE: CameraPose((1.25, -1.0, 0.72), (0.0, 0.0, 0.35)),
    Preset.FRONT: CameraPose((1.64, 0.0, 0.46), (0.0, 0.0, 0.36)),
    Preset.SIDE: CameraPose((0.0, -1.64, 0.46), (0.0, 0.0, 0.36)),
    Preset.LEFT: CameraPose((0.0, 1.64, 0.46), (0.0, 0.0, 0.36)),
    Preset.BACK: CameraPose((-1.64, 0.0, 0.46), (0.0, 0.0, 0.36)),
    # Not exactly from above: a camera that looks along its up direction is undefined.
    Preset.TOP: CameraPose((0.0, -0.01, 2.16), (0.0, 0.0, 0.2)),
}
"""Cameras as near as possible with the arm in the picture in every posture.

FREE also shows cup and basin.
"""
