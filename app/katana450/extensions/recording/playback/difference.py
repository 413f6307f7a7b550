"""Difference of two runs over one clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from katana450.errors import InputError
from katana450.extensions.recording.messages import StateRow

MAX_POINTS = 200
"""Number of points of a plot."""


class RunDifference(NamedTuple):
    """Differences at times ``t`` [s] since the start of both runs.

    Attributes:
        t: the times [s].
        joints: largest difference of a joint that turns [deg]; empty if none does.
        slides: largest difference of a joint that slides [mm]; empty if none does.
        tool: distance of the tool points [mm]; empty for robots without a tool.
    """

    t: list[float]
    joints: list[float]
    slides: list[float]
    tool: list[float]


def times_of(length: float) -> list[float]:
    """Return the times of the points of a plot over ``length`` [s]."""
    found: list[float] = np.linspace(0.0, max(length, 0.0), MAX_POINTS).tolist()
    return found


def difference(
    times: Sequence[float],
    first: Sequence[StateRow | None],
    second: Sequence[StateRow | None],
    slides: Sequence[bool],
) -> RunDifference:
    """Return the differences of the states of two runs at ``times`` [s].

    Times at which one of them has no state are left out. ``slides`` says of each joint whether it
    slides. Raises InputError for robots with other joints.
    """
    found = RunDifference([], [], [], [])
    sliding = np.array(slides, dtype=bool)
    for t, a, b in zip(times, first, second, strict=True):
        if a is None or b is None:
            continue
        counts = len(a.joints), len(b.joints), len(sliding)
        if len(set(counts)) > 1:
            raise InputError("The runs have {} and {} joints, the robot {}.".format(*counts))
        away = np.abs(np.subtract(a.joints, b.joints))
        found.t.append(t)
        if not sliding.all():
            found.joints.append(float(np.degrees(away[~sliding].max())))
        if sliding.any():
            found.slides.append(1e3 * float(away[sliding].max()))
        if a.position is not None and b.position is not None:
            found.tool.append(1e3 * float(np.linalg.norm(np.subtract(a.position, b.position))))
    return found
