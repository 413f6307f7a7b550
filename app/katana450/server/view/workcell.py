"""The table in the scene."""

from __future__ import annotations

import viser

from katana450.arm.robot.props import Props

SHADE = 0.35
"""Darkness (0 to 1) of shadows on the table."""


class Workcell:
    """The table, drawn from its GLB file."""

    def __init__(self, server: viser.ViserServer, props: Props) -> None:
        # If the table top cast shadows, it would shade its own face.
        server.scene.add_glb(
            "/table", props.table.mesh.read_bytes(), cast_shadow=False, receive_shadow=SHADE
        )
