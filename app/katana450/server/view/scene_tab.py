"""The tab "Scene" of the panel: display options, and a problem of the event log."""

from __future__ import annotations

from html import escape

import viser

from katana450.server.view.controls import GestureGate
from katana450.server.view.display_options import DisplayOptions, add_shows, add_views


class SceneTab:
    """The controls of the display."""

    def __init__(self, gui: viser.GuiApi, gestures: GestureGate, shows: DisplayOptions) -> None:
        """Add the controls to the open tab of ``gui``.

        Args:
            gui: viser's controls.
            gestures: The path of gestures to the arm.
            shows: The functions of the controls.
        """
        add_views(gui, shows)
        with gui.add_folder("Show"):
            add_shows(gui, shows)
        self._gestures, self._problem = gestures, gui.add_html("", visible=False)

    def follow(self) -> None:
        """Show a problem of the event log."""
        content = problem_page(self._gestures.log_problem)
        if content != self._problem.content:
            self._problem.content, self._problem.visible = content, bool(content)


def problem_page(problem: str) -> str:
    """Return the ``problem`` of the event log on disk as HTML; empty for none."""
    text = f"<div class='k450'><p class='status fault'>{escape(problem)}</p></div>"
    return text if problem else ""
