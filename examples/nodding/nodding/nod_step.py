"""The script step ``nod``, which turns the fourth joint there and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from katana450.sdk import PlanState, Step, commands, kinds
from nodding.nodder import JOINT


@dataclass(frozen=True)
class NodStep(Step, word="nod"):
    """Turn the fourth joint by an angle, and back.

    Attributes:
        by: The angle [rad].
    """

    by: Annotated[float, kinds.angle(-45.0, 45.0)]

    def build(self, plan: PlanState) -> PlanState:
        """Return ``plan`` with both motions. Raises InputError if no path is found."""
        nod = commands.Nudge(JOINT, self.by).targets(plan.q)
        return plan.move_to(nod, "nod").move_to(plan.q, "nod back")
