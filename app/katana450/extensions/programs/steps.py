"""All program steps by name.

To add a kind, write a class with `schema`, `read` and `build` as in `Step`, and list it in `STEPS`
of its module.
"""

from __future__ import annotations

from katana450.extensions.programs import (
    grasp,
    grip_until,
    moves,
    pick,
    place,
    pouring,
    settings_steps,
    table,
    tool_moves,
    trajectory,
    wait_for,
)
from katana450.extensions.programs.step import Step

STEPS: dict[str, type[Step]] = {
    **moves.STEPS,
    **tool_moves.STEPS,
    **settings_steps.STEPS,
    **table.STEPS,
    **grasp.STEPS,
    **grip_until.STEPS,
    **pouring.STEPS,
    **pick.STEPS,
    **place.STEPS,
    **wait_for.STEPS,
    **trajectory.STEPS,
}
"""The class of each step by its name in a script."""
