"""The table."""

from __future__ import annotations

import viser

from katana450.arm.robot.props import Props

SHADE = 0.35
"""How dark shadows on the table are."""


class Workcell:
    """Its GLB file as it is."""

    def __init__(self, server: viser.ViserServer, props: Props) -> None:
        # A board that casts shadows would shade its own face.
        server.scene.add_glb(
            "/table", props.table.mesh.read_bytes(), cast_shadow=False, receive_shadow=SHADE
        )
