"""The water in the scene: in the cup, in the air, in the basin and on the table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import viser

from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Water, WaterFlow
from katana450.maths.water.parcel import THICKNESS, landing
from katana450.maths.water.surface import (
    BODY_FACES,
    COLOUR,
    STREAM_FACES,
    Faces,
    body,
    disc,
    stream,
)
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import Window

IN_VESSEL, IN_AIR, ON_TABLE = 0.58, 0.5, 0.3
"""Opacity (0 to 1) of the water in each place."""

WORTH_SHOWING = MILLILITRE // 20
"""Smallest amount [fl] that is shown: one drop."""

WORTH_SENDING = 1e-4
"""Smallest change [m] that is sent. A pixel is 8 times as wide, 1 m away in a window of 900 px."""

CLEAR = 3e-4
"""Distance [m] of the drawn water from the basin's floor, so that the two do not flicker."""

INSET = (0.99, 0.99, 1.0)
"""Scale that keeps the drawn water off the cup's wall, which has corners in the drawing."""

FLAT = 5e-3
"""Radius [m] below which a puddle is a drop, whose height shrinks with its radius."""


class WaterPart(NamedTuple):
    """A part of the water as a mesh. One of the same name always has the same faces.

    Attributes:
        name: name among the parts: ``vessel0`` and so on, stream, basin, ``puddle0`` and so on.
        corners: (n, 3) in the base frame [m].
        faces: (m, 3) corners of each triangle, counterclockwise seen from outside.
        opacity: from 0 to 1.
    """

    name: str
    corners: FloatArray
    faces: Faces
    opacity: float


def parts_of(water: Water, water_environment: WaterEnvironment) -> list[WaterPart]:
    """Return all visible parts of the water."""
    parts: list[WaterPart] = []
    basin, flow = water_environment.basin, WaterFlow(water_environment)
    level = basin.level(water.basin * FEMTOLITRE)
    for number, held in enumerate(water.vessels):
        vessel, T = water_environment.vessels.get(held.name), held.T
        if vessel is not None and held.volume >= WORTH_SHOWING:
            local = body(vessel.inside, flow.surface(held)) * INSET
            corners = local @ T[:3, :3].T + (T[:3, 3] + vessel.floor * T[:3, 2])
            parts.append(WaterPart(f"vessel{number}", corners, BODY_FACES, IN_VESSEL))
    if water.parcels:
        end = landing(water.parcels[0], water_environment, level).age
        corners = stream(water.parcels, water_environment.cup.inside.radius, end)
        parts.append(WaterPart("stream", corners, STREAM_FACES, IN_AIR))
    if water.basin >= WORTH_SHOWING:
        level = max(level, CLEAR)
        radius, (x, y, z) = basin.radius(level), basin.at
        corners, faces = disc()
        corners = corners * (radius, radius, level) + (x, y, z + basin.floor)
        parts.append(WaterPart("basin", corners, faces, IN_VESSEL))
    for number, puddle in enumerate(water.puddles):
        corners, faces = disc()
        thickness = THICKNESS * min(puddle.radius / FLAT, 1.0)
        corners = corners * (puddle.radius, puddle.radius, thickness) + puddle.at
        parts.append(WaterPart(f"puddle{number}", corners, faces, ON_TABLE))
    return parts


class WaterLayer(ViewLayer):
    """The water as a layer of the scene, without controls."""

    def attach(self, context: LayerContext) -> None:
        """Prepare for the water of a session."""
        self._server, self._session = context.server, context.session
        # Made on the first state with water.
        self._nodes: WaterNodes | None = None

    def follow(self, state: State) -> None:
        """Draw the water of ``state``; hide the nodes without water."""
        pouring = self._session.pouring
        if pouring is None or state.poured is None:
            if self._nodes is not None:
                self._nodes.hide()
            return
        water_environment = pouring.water_environment(state.objects)
        if self._nodes is None:
            self._nodes = WaterNodes(self._server, water_environment)
        self._nodes.stand(water_environment)
        self._nodes.show(state.poured.water)


class WaterNodes:
    """The nodes of the water. Only visible changes are sent, and nothing of water at rest."""

    def __init__(
        self, server: Window, water_environment: WaterEnvironment, path: str = "/water"
    ) -> None:
        """Add the hidden node ``path``."""
        self._server, self._path = server, path
        self._water_environment = water_environment
        self._shown: Water | None = None
        self._root = server.scene.add_frame(path, show_axes=False, visible=False)
        # Made on first use: a good run spills nothing.
        self._handles: dict[str, viser.MeshHandle] = {}

    def stand(self, water_environment: WaterEnvironment) -> None:
        """Use the cup and the basin of ``water_environment`` from now on."""
        if water_environment is not self._water_environment:
            self._water_environment, self._shown = water_environment, None

    def show(self, water: Water) -> None:
        """Draw ``water``."""
        if water is not self._shown:
            self._shown = water
            parts = {part.name: part for part in parts_of(water, self._water_environment)}
            for name, node in self._handles.items():
                _reveal(node, name in parts)
            for part in parts.values():
                self._draw(part)
        _reveal(self._root, True)

    def hide(self) -> None:
        """Hide all water."""
        _reveal(self._root, False)

    def _draw(self, part: WaterPart) -> None:
        corners = part.corners.astype(np.float32)
        node = self._handles.get(part.name)
        if node is None:
            self._handles[part.name] = self._server.scene.add_mesh_simple(
                f"{self._path}/{part.name}",
                corners,
                part.faces,
                color=COLOUR,
                opacity=part.opacity,
                cast_shadow=False,
                receive_shadow=False,
            )
        elif np.abs(node.vertices - corners).max() > WORTH_SENDING:
            node.vertices = corners


def _reveal(node: viser.SceneNodeHandle, visible: bool) -> None:
    if node.visible != visible:
        node.visible = visible
