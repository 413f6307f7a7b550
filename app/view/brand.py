"""How viser's own controls look here."""

from __future__ import annotations

import viser

BRAND = (36, 119, 212)


def dress(gui: viser.GuiApi, *, dark: bool) -> None:
    """Give the panel our colours; for the whole server or for one browser, whose ``gui`` it is."""
    gui.configure_theme(
        control_width="medium",
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND,
        dark_mode=dark,
    )
