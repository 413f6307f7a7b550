"""The room round the arm: floor, sky and light, in a light and a dark theme."""

from __future__ import annotations

import viser

from katana450.server.viser_bridge.themes import LIGHT, Theme, set_sky

FLOOR_AT = -0.0255
"""Height [m] of the floor, slightly below the table so that the two do not flicker."""


def set_up_room(server: viser.ViserServer, floor: float = FLOOR_AT) -> None:
    """Light the scene and set the light theme, which the page replaces in a dark window.

    ``floor``: its height [m].
    """
    scene = server.scene
    scene.configure_default_lights(enabled=False)
    # The key light shines from the front, left and above; the rim light sets arm and sky apart.
    scene.add_light_directional(
        "/light/key", intensity=1.7, cast_shadow=True, color=(255, 250, 242), position=KEY
    )
    scene.add_light_directional("/light/rim", intensity=0.9, color=(226, 238, 255), position=RIM)
    scene.add_light_directional("/light/fill", intensity=0.35, position=FILL)
    scene.configure_environment_map("studio", environment_intensity=0.45)
    _paint(scene, LIGHT, floor)
    set_sky(server, LIGHT)


KEY, RIM, FILL = (0.7, -0.9, 1.9), (-1.0, 1.4, 0.9), (1.2, 1.0, 0.6)
"""Positions [m] of the lights, which shine towards the base."""


def _paint(scene: viser.SceneApi, theme: Theme, floor: float) -> None:
    scene.add_grid(
        "/floor",
        infinite_grid=True,
        cell_size=0.05,
        cell_thickness=0.6,
        cell_color=theme.cell,
        section_size=0.25,
        section_thickness=1.0,
        section_color=theme.section,
        plane_color=theme.floor,
        plane_opacity=1.0,
        fade_distance=5.0,
        shadow_opacity=theme.shadow,
        position=(0.0, 0.0, floor),
    )
