"""The water in the scene: in the cup, in the air, in the basin and on the table."""

from __future__ import annotations

import numpy as np
import viser

from katana450.arm.control.state import State
from katana450.arm.robot.creases import smooth_normals
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.disk_cache import kept
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import VesselWater, Water, WaterFlow
from katana450.maths.water.parcel import landing
from katana450.maths.water.surface import (
    BODY_FACES,
    COLOUR,
    STREAM_FACES,
    Faces,
    blob,
    body,
    disc,
    stream,
)
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import Window, glb

IN_VESSEL, IN_AIR, ON_TABLE = 0.58, 0.5, 0.3
"""Opacity (0 to 1) of the water in each place."""

ROUGH = 0.08
"""Roughness (0 to 1) of the faces that mirror."""

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

TWIST = 2.4
"""Turn [rad] from puddle to puddle, which hides that all have the same shape."""


class WaterLayer(ViewLayer):
    """The water as a layer of the scene, without controls."""

    def attach(self, context: LayerContext) -> None:
        """Prepare for the water of a session."""
        self._server, self._session = context.server, context.session
        # Made on the first state with water.
        self._nodes: WaterNodes | None = None
        self._water_environment: WaterEnvironment | None = None

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
        elif water_environment is not self._water_environment:
            self._nodes.stand(water_environment)
        self._water_environment = water_environment
        self._nodes.show(state.poured.water)


class WaterNodes:
    """The nodes of the water. Only visible changes are sent, and nothing of water at rest."""

    def __init__(
        self, server: Window, water_environment: WaterEnvironment, path: str = "/water"
    ) -> None:
        """Add the hidden nodes below the new node ``path``."""
        self._server, self._path = server, path
        self._water_environment = water_environment
        self._flow = WaterFlow(water_environment)
        self._shown: Water | None = None
        # The water in each vessel by its name, with the corners that were sent.
        self._bodies: dict[str, tuple[viser.MeshHandle, FloatArray]] = {}
        self._level = 0.0
        self._root = server.scene.add_frame(path, show_axes=False, visible=False)
        corners = np.zeros((int(STREAM_FACES.max()) + 1, 3))
        self._stream = self._add("stream", corners, STREAM_FACES, IN_AIR)
        self._basin = self._add_glossy("basin", *disc(), IN_VESSEL)
        self.stand(water_environment)
        # Made on first use: a good run spills nothing.
        self._puddles: list[viser.GlbHandle] = []

    def stand(self, water_environment: WaterEnvironment) -> None:
        """Use the cup and the basin of ``water_environment`` from now on."""
        self._water_environment, self._flow = water_environment, WaterFlow(water_environment)
        x, y, z = water_environment.basin.at
        self._basin.position = (x, y, z + water_environment.basin.floor)

    def show(self, water: Water) -> None:
        """Draw ``water``."""
        last, self._shown = self._shown, water
        if water is not last:
            self._show_vessels(water, last)
            self._show_stream(water)
            self._show_basin(water)
            self._show_puddles(water)
        _reveal(self._root, True)

    def hide(self) -> None:
        """Hide all water."""
        _reveal(self._root, False)

    def _show_vessels(self, water: Water, last: Water | None) -> None:
        for vessel in water.vessels:
            before = None if last is None else last.vessel(vessel.name)
            if before is None or not _same(vessel, before):
                self._show_vessel(vessel)
        for name, (node, _) in self._bodies.items():
            if water.vessel(name) is None:
                _reveal(node, False)

    def _show_vessel(self, water: VesselWater) -> None:
        vessel, T = self._water_environment.vessels.get(water.name), water.T
        shown = vessel is not None and water.volume >= WORTH_SHOWING
        node, sent = self._bodies.get(water.name, (None, None))
        if node is not None:
            _reveal(node, shown)
        if vessel is None or not shown:
            return
        # Corners in the base frame: a moving vessel then needs one message, not two for its pose.
        local = body(vessel.inside, self._flow.surface(water)) * INSET
        corners = local @ T[:3, :3].T + (T[:3, 3] + vessel.floor * T[:3, 2])
        if node is None:
            # People name the objects, and their names may have characters that a node's may not.
            name = f"vessel{len(self._bodies)}" if self._bodies else "cup"
            node = self._add(name, corners.astype(np.float32), BODY_FACES, IN_VESSEL)
        elif sent is not None and np.abs(corners - sent).max() <= WORTH_SENDING:
            return
        else:
            node.vertices = corners.astype(np.float32)
        self._bodies[water.name] = node, corners

    def _show_stream(self, water: Water) -> None:
        _reveal(self._stream, bool(water.parcels))
        if water.parcels:
            level = self._water_environment.basin.level(water.basin * FEMTOLITRE)
            end = landing(water.parcels[0], self._water_environment, level).age
            corners = stream(water.parcels, self._water_environment.cup.inside.radius, end)
            self._stream.vertices = corners.astype(np.float32)

    def _show_basin(self, water: Water) -> None:
        basin = self._water_environment.basin
        _reveal(self._basin, water.basin >= WORTH_SHOWING)
        level = max(basin.level(water.basin * FEMTOLITRE), CLEAR)
        if self._basin.visible and abs(level - self._level) > WORTH_SENDING:
            self._level = level
            radius = basin.radius(level)
            self._basin.scale = (radius, radius, level)

    def _show_puddles(self, water: Water) -> None:
        for number in range(len(self._puddles), len(water.puddles)):
            puddle = self._add_glossy(f"puddle{number}", *blob(), ON_TABLE)
            puddle.wxyz = so3.to_quaternion(so3.exp((0.0, 0.0, TWIST * number)))
            self._puddles.append(puddle)
        for number, node in enumerate(self._puddles):
            shown = number < len(water.puddles)
            _reveal(node, shown)
            if shown:
                centre, radius = water.puddles[number].at, water.puddles[number].radius
                node.position = centre
                node.scale = (radius, radius, min(radius / FLAT, 1.0))

    def _add_glossy(
        self, name: str, corners: FloatArray, faces: Faces, opacity: float
    ) -> viser.GlbHandle:
        """Add water of a fixed shape as GLB, which mirrors the room; viser's meshes cannot."""
        return self._server.scene.add_glb(
            f"{self._path}/{name}",
            _glossy(corners, faces, (*COLOUR, opacity)),
            cast_shadow=False,
            receive_shadow=False,
        )

    def _add(
        self, name: str, corners: FloatArray, faces: Faces, opacity: float
    ) -> viser.MeshHandle:
        return self._server.scene.add_mesh_simple(
            f"{self._path}/{name}",
            corners,
            faces,
            color=COLOUR,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
        )


def _same(a: VesselWater, b: VesselWater) -> bool:
    same = a.volume == b.volume and a.slosh == b.slosh
    return same and bool((a.T == b.T).all())


def _reveal(node: viser.SceneNodeHandle, visible: bool) -> None:
    if node.visible != visible:
        node.visible = visible


def _glossy(corners: FloatArray, faces: Faces, look: tuple[float, ...]) -> bytes:
    """Return a GLB file of a shape that mirrors and is translucent.

    look: red, green and blue (0 to 255, sRGB), and the opacity (0 to 1).
    """
    return kept(lambda: _exported(corners, faces, look), bytes, corners, faces, str(look))


def _exported(corners: FloatArray, faces: Faces, look: tuple[float, ...]) -> bytes:
    red, green, blue = (part / 255.0 for part in look[:3])
    material = Material("water", (red, green, blue), rough=ROUGH)
    triangles = faces.astype(np.int64)
    shape = VisualMesh(material, corners, smooth_normals(corners, triangles), triangles)
    return glb([shape], look[3])
