"""Controls that change only the display: camera and theme."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

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
