"""The steps a script can have, by their names.

Another kind is a class with `read` and `lay` as `Step` has them, in the `STEPS` of its module.
"""

from __future__ import annotations

from katana450.extensions.programs import (
    grasp,
    moves,
    pouring,
    set_down,
    settings_steps,
    table,
    tool_moves,
)
from katana450.extensions.programs.step import Step

STEPS: dict[str, type[Step]] = {
    **moves.STEPS,
    **tool_moves.STEPS,
    **settings_steps.STEPS,
    **table.STEPS,
    **grasp.STEPS,
    **pouring.STEPS,
    **set_down.STEPS,
}
