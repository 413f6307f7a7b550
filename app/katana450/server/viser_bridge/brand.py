"""The look of viser's own controls."""

from __future__ import annotations

import viser

BRAND = (36, 119, 212)
"""Brand colour of the panel: red, green and blue, each from 0 to 255."""


def dress(gui: viser.GuiApi) -> None:
    """Set our colours for the panel of every window."""
    gui.configure_theme(
        control_width="medium", show_logo=False, show_share_button=False, brand_color=BRAND
    )
