"""Controls that change what is seen and nothing else: camera, theme, what is drawn besides."""

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
    """What the controls call.

    ellipsoid, handles: show or hide them. look_from: turns one browser's camera. layers: what
    extensions show.
    """

    ellipsoid: Callable[[bool], None]
    handles: Callable[[bool], None]
    look_from: Callable[[viser.ClientHandle, Preset], None]
    layers: tuple[ViewLayer, ...]


def add_views(gui: viser.GuiApi, shows: DisplayOptions) -> None:
    """A row of buttons, each for the browser it is clicked in."""
    views = gui.add_button_group(
        "View",
        tuple(preset.value for preset in Preset),
        hint="Where you look from; Tool rides on the tool until you choose another. "
        "Drag, right-drag and wheel turn, shift and zoom",
    )

    @views.on_click
    def _(event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            shows.look_from(event.client, Preset(views.value))


def add_shows(gui: viser.GuiApi, shows: DisplayOptions) -> None:
    """The rest of them."""
    add_themes(gui)
    box = gui.add_checkbox(
        "Velocity ellipsoid",
        initial_value=False,
        hint="How fast the tool point can go in each direction: flat where one is lost",
    )
    box.on_update(lambda _: shows.ellipsoid(box.value))
    handles = gui.add_checkbox(
        "Handles on objects",
        initial_value=False,
        hint="Arrows by which cup, basin and objects can be put elsewhere on the table",
    )
    handles.on_update(lambda _: shows.handles(handles.value))
    for layer in shows.layers:
        layer.add_controls(gui)


def add_themes(gui: viser.GuiApi) -> None:
    """Light or dark. The page changes its own theme; the server does not see the click."""
    gui.add_button_group("Theme", tuple(THEMES), hint="Of this window alone")
