"""What stands on the table, and the table."""

from __future__ import annotations

from pathlib import Path

import viser

from app.robot.props import BASIN_AT, CUP_AT, Point, Props

SHADE = 0.35
"""How dark shadows on the table are."""


class Workcell:
    """GLB files as they are."""

    def __init__(self, server: viser.ViserServer, props: Props) -> None:
        # A board that casts shadows would shade its own face.
        self._add(server, "/table", props.table.mesh, (0.0, 0.0, 0.0), cast=False, shade=SHADE)
        self._add(server, "/cup", props.cup.mesh, CUP_AT)
        self._add(server, "/basin", props.basin.mesh, BASIN_AT)

    @staticmethod
    def _add(
        server: viser.ViserServer,
        name: str,
        mesh: Path,
        position: Point,
        *,
        cast: bool = True,
        shade: float | bool = True,
    ) -> None:
        server.scene.add_glb(
            name, mesh.read_bytes(), position=position, cast_shadow=cast, receive_shadow=shade
        )
