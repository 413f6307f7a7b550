"""The branches to choose from, with the outcome and cost of each.

A person takes a branch by a button below the table. The page shows the arm on the branch whose row
is under the pointer (``static/scene/branches.js``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape

import viser

from katana450.arm.control.commands.commands import Branch
from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state.messages import degrees, part, short
from katana450.arm.control.state.state import State
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.projection import ANGLE_WORTH_TELLING, POSITION_WORTH_TELLING
from katana450.server.view.controls import Listen
from katana450.server.view.scene import Colour

COLOURS: tuple[Colour, ...] = (
    *((47, 128, 237), (124, 77, 219), (0, 150, 136), (216, 67, 121)),
    *((202, 138, 4), (14, 116, 144), (154, 52, 18), (100, 116, 139)),
)
"""Colours of the branches in their order, which colour-blind people can distinguish."""

HEADINGS = ("branch", "off by", "path", "singular")

NOTHING_LOST = "nothing"

INTERVAL = 1.0
"""Time [s] between two updates while the arm moves.

One update takes longer than several frames. The first one, which loads the engine of the collision
checks, waits as long, so that it takes no time from the first picture.
"""

Find = Callable[[State], tuple[BranchOption, ...]]
"""Returns the option for each branch in a state."""


class BranchList:
    """Table and buttons of the branches."""

    def __init__(
        self,
        gui: viser.GuiApi,
        branches: Sequence[AnyBranch],
        find: Find,
        listen: Listen,
        state: State,
    ) -> None:
        """Add the controls to the open folder of ``gui``.

        ``find``: returns the option for each of ``branches`` in a state. ``state``: shown first.
        """
        self._find = find
        self._seen: State | None = None
        self._seen_at = math.nan
        self._table = gui.add_html(_rows((), state.branch))
        take = gui.add_button_group(
            "Take",
            tuple(map(str, branches)),
            hint="Moves the arm to this branch; the target of the tool stays the same",
        )
        listen(take, lambda: Branch(name=take.value))

    def follow(self, state: State, now: float) -> None:
        """Update the branches for ``state`` at time ``now`` [s].

        The update is immediate while the arm is at rest. Otherwise, and before the first one, at
        least INTERVAL passes.
        """
        if math.isnan(self._seen_at):
            self._seen_at = now
        rests = self._seen is not None and not state.moving
        if state is self._seen or not (rests or now - self._seen_at >= INTERVAL):
            return
        self._seen, self._seen_at = state, now
        rows = _rows(self._find(state), state.branch)
        if rows != self._table.content:
            self._table.content = rows


def _rows(options: tuple[BranchOption, ...], now: AnyBranch) -> str:
    """Return the table as HTML, with one row per branch and the branch ``now`` marked."""
    head = "".join(f"<th>{escape(heading)}</th>" for heading in HEADINGS)
    rows = "".join(
        f"<tr data-branch='{choice.metrics.branch}'"
        f"{' aria-current=true' if choice.metrics.branch == now else ''}>"
        f"<th><i style='background:rgb{colour}'></i>{choice.metrics.branch}</th>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in cells_of(choice))
        + "</tr>"
        for choice, colour in zip(options, COLOURS, strict=False)
    )
    return (
        f"<div class='k450'><table class='branches'><thead><tr>{head}</tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )


def cells_of(choice: BranchOption) -> tuple[str, str, str]:
    """Return the loss, the path length and time, and the smallest singular value of a branch."""
    metrics = choice.metrics
    if choice.refusal:
        return choice.refusal.partition(" exclude")[0].removeprefix("The "), "–", "–"
    lost = []
    if metrics.position_error > POSITION_WORTH_TELLING:
        lost.append(f"{short(1e3 * metrics.position_error)} mm")
    if metrics.rotation_error > ANGLE_WORTH_TELLING:
        lost.append(f"{short(math.degrees(metrics.rotation_error))}°")
    if choice.contact is not None:
        lost.append(" meets ".join(map(part, choice.contact.parts)))
    path = f"{degrees(metrics.distance, 0)}, {metrics.time:.1f} s"
    return ", ".join(lost) or NOTHING_LOST, path, f"{metrics.smallest_singular_value:.3f}"
