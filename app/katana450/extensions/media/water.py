"""Water in a picture: the shapes of the page, in its translucent colour."""

from __future__ import annotations

import numpy as np

from katana450.arm.robot.creases import smooth_normals
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.extensions.media.picture import Translucent
from katana450.extensions.media.scene import Item
from katana450.extensions.water.nodes import (
    CLEAR,
    FLAT,
    IN_AIR,
    IN_VESSEL,
    INSET,
    ON_TABLE,
    TWIST,
    WORTH_SHOWING,
)
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Water, WaterFlow
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
from katana450.maths.water.units import FEMTOLITRE

STREAM, BASIN, PUDDLE = (
    "water in air",
    "water in basin",
    "water on table",
)
"""Names of the items of water."""

RED, GREEN, BLUE = COLOUR
MATERIAL = Material("water", (RED / 255.0, GREEN / 255.0, BLUE / 255.0))
"""Material of all water."""


def translucents_of(water: Water, water_environment: WaterEnvironment) -> list[Translucent]:
    """Return all visible parts of the water."""
    found: list[Translucent] = []
    basin, level = water_environment.basin, water_environment.basin.level(water.basin * FEMTOLITRE)
    flow = WaterFlow(water_environment)
    for each in water.vessels:
        vessel = water_environment.vessels.get(each.name)
        if vessel is not None and each.volume >= WORTH_SHOWING:
            up = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, vessel.floor))
            shape = _shape(body(vessel.inside, flow.surface(each)) * INSET, BODY_FACES)
            found.append(Translucent(Item(f"water in {each.name}", shape, each.T @ up), IN_VESSEL))
    if water.parcels:
        end = landing(water.parcels[0], water_environment, level).age
        corners = stream(water.parcels, water_environment.cup.inside.radius, end)
        shape = _shape(corners, STREAM_FACES)
        found.append(Translucent(Item(STREAM, shape, np.eye(4)), IN_AIR))
    if water.basin >= WORTH_SHOWING:
        level = max(level, CLEAR)
        radius, (x, y, z) = basin.radius(level), basin.at
        corners, faces = disc()
        shape = _shape(corners * (radius, radius, level), faces)
        T = se3.from_rotation_translation(np.eye(3), (x, y, z + basin.floor))
        found.append(Translucent(Item(BASIN, shape, T), IN_VESSEL))
    for number, puddle in enumerate(water.puddles):
        corners, faces = blob()
        scaled = corners * (puddle.radius, puddle.radius, min(puddle.radius / FLAT, 1.0))
        T = se3.from_rotation_translation(so3.rotation_z(TWIST * number), puddle.at)
        found.append(Translucent(Item(PUDDLE, _shape(scaled, faces), T), ON_TABLE))
    return found


def _shape(corners: FloatArray, faces: Faces) -> VisualMesh:
    whole = faces.astype(np.int64)
    return VisualMesh(MATERIAL, corners, smooth_normals(corners, whole), whole)
