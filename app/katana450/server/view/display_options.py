"""Controls that change only the display: camera, theme and additional drawings; the tab Scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any

import viser

from katana450.server.view.controls import GestureGate
from katana450.server.view.layer import ViewLayer
from katana450.server.viser_bridge.presets import Preset
from katana450.server.viser_bridge.themes import THEMES


@dataclass(frozen=True)
class DisplayOptions:
    """The functions that the controls call.

    Attributes:
        look_from: turns the camera of one browser.
        layers: layers of extensions.
    """

    look_from: Callable[[viser.ClientHandle, Preset], None]
    layers: tuple[ViewLayer, ...]


def add_views(gui: viser.GuiApi, shows: DisplayOptions) -> None:
    """Add the buttons of the camera views. A click changes only its own browser.

    The view cube of the page presses them, so the panel does not show them.
    """
    views = gui.add_button_group("View", tuple(preset.value for preset in Preset), visible=False)

    @views.on_click
    def _(event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            shows.look_from(event.client, Preset(views.value))


def add_shows(gui: viser.GuiApi, shows: DisplayOptions) -> None:
    """Add the controls of the folder "Show"."""
    for layer in shows.layers:
        layer.add_controls(gui)


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
