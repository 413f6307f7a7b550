"""How viser's own controls look here."""

from __future__ import annotations

import viser

BRAND = (36, 119, 212)


def dress(gui: viser.GuiApi) -> None:
    """Give the panel of every window our colours."""
    gui.configure_theme(
        control_width="medium",
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND,
    )
