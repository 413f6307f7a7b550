"""Tabs of the panel, in the order in which they are first used."""

from __future__ import annotations

import viser

from katana450.server.view.display_options import add_themes

DRIVE, SCENE = "Drive", "Scene"
"""Labels of the tabs of the core. The tabs of built-in extensions are between them."""


class PanelTabs:
    """The tabs of a panel. A tab exists as soon as something is put into it."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Add the empty group of tabs to ``gui``."""
        self._gui = gui
        self._group = gui.add_tab_group()
        self._tabs: dict[str, viser.GuiTabHandle] = {}

    def tab(self, label: str) -> viser.GuiTabHandle:
        """Return the tab ``label``, a context in which controls are added to it."""
        if label not in self._tabs:
            self._tabs[label] = self._group.add_tab(label)
            if label == SCENE:
                with self._tabs[label]:
                    add_themes(self._gui)
        return self._tabs[label]
