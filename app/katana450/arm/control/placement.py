"""Where a new thing stands: on the table in front of the arm, beside what is there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from katana450.arm.control.things import Form, Thing
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray

NEAREST, FARTHEST = 0.36, 0.60
"""[m] From axis 1, of its middle: in reach, and clear of the arm at rest in its ready posture."""

APART = 0.02
"""[m] Between two things."""

AZIMUTHS = tuple(math.radians(sign * angle) for angle in range(0, 110, 12) for sign in (1, -1))


def free_place(thing: Thing, things: Sequence[Thing]) -> FloatArray:
    """(4, 4) in the base frame: straight ahead if there is room, else aside, else farther out.

    Straight ahead too where there is room nowhere.
    """
    others = [each for each in things if each.name != thing.name and not each.carried]
    for distance in np.arange(NEAREST, FARTHEST, 0.06).tolist():
        for azimuth in AZIMUTHS:
            at = np.array((distance * math.cos(azimuth), distance * math.sin(azimuth), 0.0))
            gaps = (
                math.hypot(*(each.T[:2, 3] - at[:2])) - girth(each) - girth(thing)
                for each in others
            )
            if all(gap >= APART for gap in gaps):
                return se3.from_rotation_translation(np.eye(3), at)
    return se3.from_rotation_translation(np.eye(3), (NEAREST, 0.0, 0.0))


def girth(thing: Thing) -> float:
    """[m] How far it reaches from its middle, seen from above and upright."""
    if thing.form in (Form.CYLINDER, Form.SPHERE):
        return thing.extent[0]
    return 0.5 * math.hypot(*thing.extent[:2])
