"""Water in the scene: in the cup, in the air, in the basin, on the table."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
import viser
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Water, WaterFlow
from katana450.maths.water.parcel import landing
from katana450.maths.water.surface import BODY_FACES, STREAM_FACES, Faces, blob, body, disc, stream
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE
from katana450.server.view.scene import Colour

COLOUR: Colour = (74, 148, 192)
LIGHT: Colour = (18, 75, 134)
"""The same of light, not of sRGB: so glTF takes it."""

IN_VESSEL, IN_AIR, ON_TABLE = 0.58, 0.5, 0.3
"""How much of what is behind it water hides."""

ROUGH = 0.08
"""Of the faces that mirror."""

WORTH_SHOWING = MILLILITRE // 20
"""[fl] A drop."""

WORTH_SENDING = 1e-4
"""[m] A pixel is eight times as wide, 1 m away in a window of 900."""

CLEAR = 3e-4
"""[m] That water is drawn off the basin's floor, so that they do not flicker in each other."""

INSET = (0.99, 0.99, 1.0)
"""The same of the cup's wall, which is drawn with corners."""

FLAT = 5e-3
"""[m] A puddle of a smaller radius is a drop, and as much lower."""

TWIST = 2.4
"""[rad] From puddle to puddle: the same shape, but nobody need see that."""


class WaterNodes:
    """Sends what changed enough to be seen, and nothing of water at rest."""

    def __init__(self, server: viser.ViserServer, water_environment: WaterEnvironment) -> None:
        self._server = server
        self._water_environment = water_environment
        self._flow = WaterFlow(water_environment)
        self._shown: Water | None = None
        self._body: FloatArray | None = None
        self._level = 0.0
        inside = water_environment.cup.inside
        self._root = server.scene.add_frame("/water", show_axes=False, visible=False)
        surface = self._flow.surface(self._flow.begin(inside.capacity / 2.0, np.eye(4)))
        self._cup = self._add("cup", body(inside, surface), BODY_FACES, IN_VESSEL)
        corners = np.zeros((int(STREAM_FACES.max()) + 1, 3))
        self._stream = self._add("stream", corners, STREAM_FACES, IN_AIR)
        self._basin = self._add_glossy("basin", *disc(), IN_VESSEL)
        self.stand(water_environment)
        # Made when they are first needed: a good run spills nothing.
        self._puddles: list[viser.GlbHandle] = []

    def stand(self, water_environment: WaterEnvironment) -> None:
        """From now on cup and basin are as ``around`` says."""
        self._water_environment, self._flow = water_environment, WaterFlow(water_environment)
        x, y, z = water_environment.basin.at
        self._basin.position = (x, y, z + water_environment.basin.floor)

    def show(self, water: Water) -> None:
        """Draw ``water``."""
        last, self._shown = self._shown, water
        if water is not last:
            if last is None or not _same_in_cup(water, last):
                self._show_cup(water)
            self._show_stream(water)
            self._show_basin(water)
            self._show_puddles(water)
        _reveal(self._root, True)

    def hide(self) -> None:
        """Draw none."""
        _reveal(self._root, False)

    def _show_cup(self, water: Water) -> None:
        cup, T = self._water_environment.cup, water.T_base_cup
        _reveal(self._cup, water.cup >= WORTH_SHOWING)
        if not self._cup.visible:
            return
        # In the base frame: then a cup that moves is one message, where its pose would be two more.
        local = body(cup.inside, self._flow.surface(water)) * INSET
        corners = local @ T[:3, :3].T + (T[:3, 3] + cup.floor * T[:3, 2])
        if self._body is None or np.abs(corners - self._body).max() > WORTH_SENDING:
            self._body = corners
            self._cup.vertices = corners.astype(np.float32)

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
                at, radius = water.puddles[number].at, water.puddles[number].radius
                node.position = at
                node.scale = (radius, radius, min(radius / FLAT, 1.0))

    def _add_glossy(
        self, name: str, corners: FloatArray, faces: Faces, opacity: float
    ) -> viser.GlbHandle:
        """Water whose shape only grows: so it can mirror the room, as no mesh of viser's does."""
        return self._server.scene.add_glb(
            f"/water/{name}",
            _glossy(corners, faces, opacity),
            cast_shadow=False,
            receive_shadow=False,
        )

    def _add(
        self, name: str, corners: FloatArray, faces: Faces, opacity: float
    ) -> viser.MeshHandle:
        return self._server.scene.add_mesh_simple(
            f"/water/{name}",
            corners,
            faces,
            color=COLOUR,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
        )


def _same_in_cup(a: Water, b: Water) -> bool:
    same = a.cup == b.cup and a.slosh == b.slosh
    return same and bool((a.T_base_cup == b.T_base_cup).all())


def _reveal(node: viser.SceneNodeHandle, visible: bool) -> None:
    if node.visible != visible:
        node.visible = visible


def _glossy(corners: FloatArray, faces: Faces, opacity: float) -> bytes:
    """A GLB file of a shape that mirrors and lets through the rest of the light."""
    # trimesh says nothing of the types of these.
    pbr: Any = PBRMaterial
    textured: Any = TextureVisuals
    material = pbr(
        baseColorFactor=[*LIGHT, round(255 * opacity)],
        metallicFactor=0.0,
        roughnessFactor=ROUGH,
        alphaMode="BLEND",
    )
    mesh = trimesh.Trimesh(corners, faces, process=False, visual=textured(material=material))
    glb: Any = mesh.export(file_type="glb", include_normals=True)
    return bytes(glb)
