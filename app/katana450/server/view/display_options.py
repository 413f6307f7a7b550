"""The views of the camera, which change only the display."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from katana450.server.viser_bridge.presets import Preset


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
