"""All program steps by name: the modules of the steps enter their classes.

To add a kind, write a class as ``Step`` describes it. List a new module here. Extensions of other
distributions add steps by their part ``step``.
"""

from __future__ import annotations

from katana450.extension import provided
from katana450.extensions.programs.building.step import STEPS
from katana450.extensions.programs.steps import (
    grasp,
    moves,
    place,
    pouring,
    settings_steps,
    tool_moves,
    trajectory,
)

MODULES = (
    moves, tool_moves, settings_steps, grasp, pouring, place,
    trajectory,
)  # fmt: skip
"""The modules with steps."""

ADDED = tuple(provided("step"))
"""The steps of other distributions."""

__all__ = ["MODULES", "STEPS"]
