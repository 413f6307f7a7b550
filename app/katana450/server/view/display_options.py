"""Controls that change only the display: camera, theme and additional drawings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import viser

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
