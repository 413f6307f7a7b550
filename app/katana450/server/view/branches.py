"""The branches to choose from: what each would give and cost, and two ways to take one.

A table and buttons in the panel; and, when a person asks to see them, the arm as it would
stand, to be clicked.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from html import escape

import viser

from katana450.arm.control.branch_options import BranchOption
from katana450.arm.control.commands import TakeBranch
from katana450.arm.control.messages import BRANCH_HEADINGS, branch_cells
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.server.view.controls import Listen
from katana450.server.view.scene import Colour, GhostNodes

COLOURS: tuple[Colour, ...] = ((47, 128, 237), (124, 77, 219), (0, 150, 136), (216, 67, 121))
"""One for each of BRANCHES, told apart by people of every kind of sight; the table has them too."""

OPACITY = 0.25

NONE, OTHERS = "None", "All others"
"""Whose ghosts are shown, beside that of one branch alone."""

INTERVAL = 1.0
"""[s] Between two looks at the branches while the arm moves and none is shown: a look costs more
than several pictures."""

Find = Callable[[State], tuple[BranchOption, ...]]
"""The choice on each of BRANCHES."""


class BranchList:
    """Looking at the branches changes nothing."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        find: Find,
        listen: Listen,
        state: State,
    ) -> None:
        self._server = server
        self._find = find
        self._robot = robot
        self._listen = listen
        self._seen = state
        self._seen_at = -math.inf
        self._ghosts: list[GhostNodes] = []
        # Ghosts are chosen in a thread of viser's.
        self._lock = threading.Lock()
        found = find(state)
        self._table = server.gui.add_html(_rows(found, state.branch))
        self._wanted = server.gui.add_dropdown(
            "Ghosts",
            (NONE, OTHERS, *(str(branch) for branch in BRANCHES)),
            initial_value=NONE,
            hint="Shows the arm as it would stand; click a ghost and the arm goes there",
        )
        self._wanted.on_update(lambda _: self._show())
        take = server.gui.add_button_group(
            "Take",
            tuple(str(branch) for branch in BRANCHES),
            hint="The tool where it is wished, the arm on this branch",
        )
        listen(take, lambda: TakeBranch(Branch.parse(take.value)))

    def follow(self, state: State, now: float) -> None:
        """Show what the branches come to from ``state`` at time ``now`` [s].

        At once when the arm is at rest or a person watches the ghosts; else after INTERVAL.
        """
        watched = self._wanted.value != NONE or not state.moving
        if state is self._seen or not (watched or now - self._seen_at >= INTERVAL):
            return
        self._seen, self._seen_at = state, now
        self._show()

    def _show(self) -> None:
        with self._lock:
            self._draw(self._seen)

    def _draw(self, state: State) -> None:
        found = self._find(state)
        rows = _rows(found, state.branch)
        if rows != self._table.content:
            self._table.content = rows
        wanted = self._wanted.value
        if wanted != NONE and not self._ghosts:
            # Made when first wanted: three more arms are half of what a page loads.
            self._ghosts = [self._ghost(number) for number in range(len(BRANCHES))]
        for ghost, choice in zip(self._ghosts, found, strict=False):
            branch = choice.metrics.branch
            visible = wanted in (OTHERS, str(branch)) and branch != state.branch
            ghost.root.visible = visible
            if visible:
                ghost.move(self._robot.joint_values(choice.metrics.q, state.gripper))

    def _ghost(self, number: int) -> GhostNodes:
        branch = BRANCHES[number]
        name = f"/branch/{branch}"
        ghost = GhostNodes(self._server, self._robot, name, COLOURS[number], OPACITY)
        for shape in ghost.shapes:
            self._listen(shape, lambda: TakeBranch(branch))
        return ghost


def _rows(found: tuple[BranchOption, ...], now: Branch) -> str:
    """A row a branch, that of ``now`` marked."""
    head = "".join(f"<th>{escape(heading)}</th>" for heading in BRANCH_HEADINGS)
    rows = "".join(
        f"<tr data-branch='{choice.metrics.branch}'"
        f"{' aria-current=true' if choice.metrics.branch == now else ''}>"
        f"<th><i style='background:rgb{colour}'></i>{choice.metrics.branch}</th>"
        + "".join(f"<td>{escape(said)}</td>" for said in branch_cells(choice))
        + "</tr>"
        for choice, colour in zip(found, COLOURS, strict=True)
    )
    return (
        f"<div class='k450'><table class='branches'><thead><tr>{head}</tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )
