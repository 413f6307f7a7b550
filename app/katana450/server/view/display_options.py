"""Controls that change only the display: camera and theme; the problem of the event log."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import viser

from katana450.server.view.controls import GestureGate
from katana450.server.viser_bridge.presets import Preset
from katana450.server.viser_bridge.themes import THEMES


def add_views(gui: viser.GuiApi, look_from: Callable[[viser.ClientHandle, Preset], None]) -> None:
    """Add the buttons of the camera views. A click changes only its own browser.

    The view cube of the page presses them, so the panel does not show them. ``look_from`` turns the
    camera of one browser.
    """
    views = gui.add_button_group("View", tuple(preset.value for preset in Preset), visible=False)

    @views.on_click
    def _(event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            look_from(event.client, Preset(views.value))


def add_themes(gui: viser.GuiApi) -> None:
    """Add the theme buttons. The page changes its own theme; the server does not see the click."""
    gui.add_button_group("Theme", tuple(THEMES), hint="Only for this window")


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
