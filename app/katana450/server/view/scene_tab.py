"""The tab "Scene" of the panel: display options, and a problem of the event log."""

from __future__ import annotations

from html import escape

import viser

from katana450.server.view.controls import GestureGate
from katana450.server.view.display_options import DisplayOptions, add_shows, add_views


class LogProblem:
    """The problem of the event log on disk, hidden if there is none."""

    def __init__(self, gui: viser.GuiApi, gestures: GestureGate) -> None:
        """Add it to the open tab of ``gui``."""
        self._gestures, self._page = gestures, gui.add_html("", visible=False)

    def follow(self) -> None:
        """Show the present problem."""
        problem = escape(self._gestures.log_problem)
        content = problem and f"<div class='k450'><p class='status fault'>{problem}</p></div>"
        if content != self._page.content:
            self._page.content, self._page.visible = content, bool(content)


def add_scene_tab(gui: viser.GuiApi, gestures: GestureGate, shows: DisplayOptions) -> LogProblem:
    """Add the controls of the display to the open tab of ``gui``; return the problem below them.

    Args:
        gui: viser's controls.
        gestures: The path of gestures to the arm.
        shows: The functions of the controls.
    """
    add_views(gui, shows)
    with gui.add_folder("Show"):
        add_shows(gui, shows)
    return LogProblem(gui, gestures)
