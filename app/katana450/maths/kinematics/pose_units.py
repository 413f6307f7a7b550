"""Numbers of a pose that are not in metres and radians, as far as an arm's reach shows it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from katana450.errors import InputError
from katana450.maths.kinematics.chain import Chain

FAR: Final = 30.0
"""[1] Ratio of a distance to the reach from which on its unit is in doubt."""

MILLIMETRES: Final = 1.5e3
"""[1] The same from which on it would be out of reach in millimetres, too."""

LARGEST_ANGLE: Final = 2.1 * math.pi
"""[rad] Angle above which its unit is in doubt."""


def check_metres(chain: Chain, position: Iterable[float], name: str = "The pose") -> None:
    """Raise InputError for a tool point (3,) in {S} that is within reach in millimetres, not in m.

    The message asks for the unit; a target out of reach would be a wrong answer.
    """
    distance = math.hypot(*position)
    if FAR * chain.reach < distance < MILLIMETRES * chain.reach:
        raise InputError(
            f"{name} is {distance:.0f} m away, and the arm reaches {chain.reach:.2g} m. Did you "
            "mean metres? Lengths are in metres here; divide millimetres by 1000."
        )


def check_radians(angles: Iterable[float], name: str) -> None:
    """Raise InputError for an angle [rad] of more than a turn, which degrees would explain."""
    for angle in angles:
        if LARGEST_ANGLE < abs(angle) < math.inf:
            raise InputError(
                f"{name} has the angle {angle:g}, more than a turn. Did you mean radians? "
                f"{angle:g} deg are {math.radians(angle):.4g} rad."
            )
