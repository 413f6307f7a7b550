"""Where a program has the arm at a time: its plans one after another."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from app.geometry.arrays import FloatArray
from app.planning.plan import Plan
from app.programs.order import Go
from app.programs.program import Program


@dataclass(frozen=True, eq=False)
class Timeline:
    """The motions of a program, at full speed but for the ramps; what they wait for is left out.

    plans: in their order. begins: [s] when each does, and the last ends.
    """

    plans: tuple[Plan, ...]
    begins: tuple[float, ...]

    @staticmethod
    def of(program: Program) -> Timeline:
        """Of ``program``."""
        plans = tuple(task.order.plan for task in program.tasks if isinstance(task.order, Go))
        return Timeline(plans, tuple(accumulate((plan.span for plan in plans), initial=0.0)))

    @property
    def span(self) -> float:
        """[s] to its end."""
        return self.begins[-1]

    def at(self, t: float) -> tuple[FloatArray, float]:
        """The joints (5,) and the fingers [rad] at ``t`` [s], from 0 to ``span``.

        There has to be a plan.
        """
        number = min(max(bisect_right(self.begins, t) - 1, 0), len(self.plans) - 1)
        plan = self.plans[number]
        return plan.q(min(max(t - self.begins[number], 0.0), plan.span)), plan.fingers

    def postures(self, count: int) -> list[tuple[FloatArray, float]]:
        """``count`` of them evenly, from start to end."""
        return [self.at(t) for t in np.linspace(0.0, self.span, count).tolist()]
