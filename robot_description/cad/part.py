"""A part: the solids of one link, one for each material."""

from __future__ import annotations

from manifold3d import Manifold

from robot_description.cad.material import MATERIALS, Material

SIMPLIFY = 0.004
"""Edges and bumps smaller than this, left by booleans, are removed; mm."""


class Part:
    """The geometry of one link in its frame, mm."""

    def __init__(self, link: str) -> None:
        self.link = link
        self._solids: dict[Material, Manifold] = {}

    def add(self, material: Material, *solids: Manifold) -> None:
        """Add ``solids`` to the solid of ``material``."""
        for solid in solids:
            there = self._solids.get(material)
            self._solids[material] = solid if there is None else there + solid

    def cut(self, *tools: Manifold, of: Material | None = None) -> None:
        """Remove ``tools`` from every material, or only from ``of``."""
        for material in [of] if of is not None else list(self._solids):
            for tool in tools:
                self._solids[material] = self._solids[material] - tool

    def bodies(self) -> list[tuple[Material, Manifold]]:
        """Return one solid for each material used, in the fixed order of the materials.

        Raises:
            ValueError: a cut has removed all of a material.
        """
        bodies = []
        for material in MATERIALS:
            if material not in self._solids:
                continue
            solid = self._solids[material].simplify(SIMPLIFY)
            if solid.is_empty():
                raise ValueError(f"{self.link}: nothing is left of its {material.name}")
            bodies.append((material, solid))
        return bodies
