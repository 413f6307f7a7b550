"""The script step ``nod``, which turns the fourth joint there and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from katana450.sdk import PlanBuilder, Step, commands, kinds
from nodding.nodder import JOINT


@dataclass(frozen=True)
class NodStep(Step, word="nod"):
    """Turn the fourth joint by an angle, and back.

    Attributes:
        by: The angle [rad].
    """

    by: Annotated[float, kinds.angle(-45.0, 45.0)]

    def build(self, builder: PlanBuilder) -> None:
        """Plan both motions. Raises InputError if no path is found."""
        start = builder.q
        builder.move_to(commands.Nudge(JOINT, self.by).targets(start), "nod")
        builder.move_to(start, "nod back")
