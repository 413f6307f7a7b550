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
        self._problem = LogProblem(gui, gestures)

    def follow(self) -> None:
        """Show a problem of the event log."""
        self._problem.follow()


class LogProblem:
    """Why events are not recorded on disk, hidden while they are."""

    def __init__(self, gui: viser.GuiApi, gestures: GestureGate) -> None:
        """Add it to the open tab of ``gui``."""
        self._gestures, self._page = gestures, gui.add_html("", visible=False)

    def follow(self) -> None:
        """Show the present problem."""
        problem = self._gestures.log_problem
        text = f"<div class='k450'><p class='status fault'>{escape(problem)}</p></div>"
        content = text if problem else ""
        if content != self._page.content:
            self._page.content, self._page.visible = content, bool(content)
