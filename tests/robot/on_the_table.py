"""A block that stands beside the column of hands.py, below its beam."""

from __future__ import annotations

import numpy as np

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.maths.geometry import se3


def block(table: float = 0.0, y: float = 0.0) -> SceneObject:
    """Return a block 0.1 m high on a table at the height ``table`` [m], at ``y`` [m]."""
    T = se3.from_rotation_translation(np.eye(3), (0.2, y, table))
    return SceneObject("block", Shape.BOX, (0.05, 0.05, 0.1), T)
