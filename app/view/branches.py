"""The branches in the panel: what each would give and cost, and a button to take it."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

import viser

from app.control.choices import choices
from app.control.state import State
from app.kinematics.branch import BRANCHES
from app.robot.model import RobotModel
from app.view.texts import BRANCH_HEADINGS, badge


class BranchList:
    """A table and a button a branch; looking at them changes nothing."""

    def __init__(
        self,
        gui: viser.GuiApi,
        model: RobotModel,
        take: Callable[[viser.GuiButtonHandle, int], None],
        state: State,
    ) -> None:
        """``take`` makes a button ask for the branch of that number in BRANCHES."""
        self._model = model
        self._seen = state
        self._table = gui.add_html(self._rows(state))
        for number, branch in enumerate(BRANCHES):
            button = gui.add_button(
                f"Take {branch}", hint="The tool where it is wished, the arm on this branch"
            )
            take(button, number)

    def follow(self, state: State) -> None:
        """Show what the branches come to from ``state``."""
        if state is not self._seen:
            self._seen = state
            rows = self._rows(state)
            if rows != self._table.content:
                self._table.content = rows

    def _rows(self, state: State) -> str:
        head = "".join(f"<th>{escape(heading)}</th>" for heading in BRANCH_HEADINGS)
        rows = "".join(
            f"<tr data-branch='{choice.branch}'><th>{choice.branch}</th>"
            + "".join(f"<td>{escape(said)}</td>" for said in badge(choice))
            + "</tr>"
            for choice in choices(self._model.arm, state)
        )
        return (
            f"<div class='k450'><table class='branches'><thead><tr>{head}</tr></thead>"
            f"<tbody>{rows}</tbody></table></div>"
        )
