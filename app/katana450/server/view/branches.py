"""The branches to choose from, with the outcome and cost of each.

A person takes a branch by a button below the table in the panel, or by a click on its ghost, which
shows the arm on that branch. Ghosts are shown on request.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from html import escape

import viser

from katana450.arm.control.commands import Branch
from katana450.arm.control.messages import degrees, part, short
from katana450.arm.control.state import State
from katana450.arm.control.tool_targets import BranchOption
from katana450.arm.robot.robot import Robot
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.projection import ANGLE_WORTH_TELLING, POSITION_WORTH_TELLING
from katana450.server.view.controls import Listen
from katana450.server.view.scene import Colour, GhostNodes

COLOURS: tuple[Colour, ...] = (
    *((47, 128, 237), (124, 77, 219), (0, 150, 136), (216, 67, 121)),
    *((202, 138, 4), (14, 116, 144), (154, 52, 18), (100, 116, 139)),
)
"""Colours of the branches in their order, which colour-blind people can distinguish."""

OPACITY = 0.25

HEADINGS = ("branch", "off by", "path", "singular")

NOTHING_LOST = "nothing"

NONE, OTHERS = "None", "All others"
"""Choices of the ghosts that are shown, in addition to each single branch."""

INTERVAL = 1.0
"""Time [s] between two updates while the arm moves and no ghost is shown.

One update takes longer than several frames. The first one, which loads the engine of the collision
checks, waits as long, so that it takes no time from the first picture.
"""

Find = Callable[[State], tuple[BranchOption, ...]]
"""Returns the option for each branch in a state."""


class BranchList:
    """Table, ghosts and buttons of the branches. The choice of a ghost changes only the display."""

    def __init__(
        self, server: viser.ViserServer, robot: Robot, find: Find, listen: Listen, state: State
    ) -> None:
        self._server = server
        self._find = find
        self._robot = robot
        self._listen = listen
        self._seen: State | None = None
        self._seen_at = math.nan
        self._branches = robot.require_arm().kinematics.branches
        self._ghosts: list[GhostNodes] = []
        # viser calls `_show` in a thread of its own when a ghost is chosen.
        self._lock = threading.Lock()
        self._table = server.gui.add_html(_rows((), state.branch))
        self._ghost_choice = server.gui.add_dropdown(
            "Ghosts",
            (NONE, OTHERS, *map(str, self._branches)),
            initial_value=NONE,
            hint="Shows the arm on other branches. Click a ghost to move the arm there",
        )
        self._ghost_choice.on_update(lambda _: self._show())
        take = server.gui.add_button_group(
            "Take",
            tuple(map(str, self._branches)),
            hint="Moves the arm to this branch; the target of the tool stays the same",
        )
        listen(take, lambda: Branch(name=take.value))

    def follow(self, state: State, now: float) -> None:
        """Update the branches for ``state`` at time ``now`` [s].

        The update is immediate while the arm is at rest or ghosts are shown. Otherwise at least
        INTERVAL passes. The first update waits INTERVAL, unless a ghost is chosen.
        """
        if math.isnan(self._seen_at):
            self._seen_at = now
        rests = self._seen is not None and not state.moving
        watched = self._ghost_choice.value != NONE or rests
        if state is self._seen or not (watched or now - self._seen_at >= INTERVAL):
            return
        self._seen, self._seen_at = state, now
        self._show()

    def _show(self) -> None:
        with self._lock:
            if self._seen is not None:
                self._draw(self._seen)

    def _draw(self, state: State) -> None:
        options = self._find(state)
        rows = _rows(options, state.branch)
        if rows != self._table.content:
            self._table.content = rows
        wanted = self._ghost_choice.value
        if wanted != NONE and not self._ghosts:
            # Made on the first request: three more arms are half of the data that a page loads.
            self._ghosts = [self._ghost(number) for number in range(len(self._branches))]
        for ghost, choice in zip(self._ghosts, options, strict=False):
            branch = choice.metrics.branch
            visible = wanted in (OTHERS, str(branch)) and branch != state.branch
            visible = visible and not choice.refusal
            ghost.root.visible = visible
            if visible:
                ghost.move(self._robot.joint_values(choice.metrics.q, state.gripper))

    def _ghost(self, number: int) -> GhostNodes:
        branch = self._branches[number]
        name = f"/branch/{branch}"
        ghost = GhostNodes(self._server, self._robot, name, COLOURS[number], OPACITY)
        for shape in ghost.shapes:
            self._listen(shape, lambda: Branch(name=str(branch)))
        return ghost


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
