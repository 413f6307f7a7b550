"""The raw solids of the links and their robot, built once for all tests."""

from __future__ import annotations

import functools

import yourdfpy
from manifold3d import Manifold

from katana450.resources import URDF_PATH
from robot_description.cad.build import PARTS


@functools.cache
def solid(link: str) -> Manifold:
    """Return all bodies of ``link`` as one solid, mm."""
    part = next(make() for make in PARTS if make.__name__ == link)
    return functools.reduce(lambda a, b: a + b, (body for _, body in part.bodies()))


@functools.cache
def robot() -> yourdfpy.URDF:
    return yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False)
