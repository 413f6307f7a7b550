"""The posture of the arm at a time of a program."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.program import Program
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.plan import Segment


@dataclass(frozen=True, eq=False)
class Timeline:
    """The motions of a program at full speed, on the clock of `Program.duration`.

    Pauses between the motions, such as for the gripper, are left out.

    Attributes:
        pieces: segments in their order, each with its finger joint [rad].
        begins: start times of the segments and the end of the last [s].
    """

    pieces: tuple[tuple[Segment, float], ...]
    begins: tuple[float, ...]

    @staticmethod
    def of(program: Program) -> Timeline:
        """Return the timeline of ``program``."""
        plans = [task.action.plan for task in program.tasks if isinstance(task.action, FollowPlan)]
        pieces = tuple((segment, plan.fingers) for plan in plans for segment in plan.segments)
        durations = (segment.scaling.duration for segment, _ in pieces)
        return Timeline(pieces, tuple(accumulate(durations, initial=0.0)))

    @property
    def span(self) -> float:
        """The duration [s]."""
        return self.begins[-1]

    def at(self, t: float) -> tuple[FloatArray, float]:
        """Return the joints (5,) and the fingers [rad] at ``t`` [s], from 0 to ``span``.

        The timeline must not be empty.
        """
        number = min(max(bisect_right(self.begins, t) - 1, 0), len(self.pieces) - 1)
        segment, fingers = self.pieces[number]
        return segment.at(segment.scaling.tau_after(t - self.begins[number])).q, fingers

    def postures(self, count: int) -> list[tuple[FloatArray, float]]:
        """Return ``count`` postures (joints and fingers [rad]), evenly spaced in time."""
        return [self.at(t) for t in np.linspace(0.0, self.span, count).tolist()]
