"""What stands on the table, and the table."""

from __future__ import annotations

from pathlib import Path

import viser

from app.robot.props import Props

Point = tuple[float, float, float]

CUP_AT: Point = (0.34, -0.26, 0.0)
BASIN_AT: Point = (0.22, 0.36, 0.0)
"""[m] On the table in the base frame: in reach, and out of the way until wanted."""


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
