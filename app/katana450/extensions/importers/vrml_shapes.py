"""The surface or the lines of each geometry node of VRML97 and X3D."""

from __future__ import annotations

from collections import Counter

import numpy as np

from katana450.extensions.export.vrml_node import Node
from katana450.extensions.importers.surface import MeshSurface
from katana450.extensions.importers.vrml_flat import FLAT
from katana450.extensions.importers.vrml_lines import LINES
from katana450.extensions.importers.vrml_solids import SOLIDS, numbers

MAKERS = {**SOLIDS, **FLAT, **LINES}
"""The function that builds the surface or lines, by the kind of a node."""

LENGTHS = {
    "Box": ("size",),
    "Cone": ("bottomRadius", "height"),
    "Cylinder": ("radius", "height"),
    "Sphere": ("radius",),
}
"""Lengths of a solid, the radius first."""


def surface_of(node: Node, name: str, left_out: Counter[str]) -> MeshSurface | None:
    """Return the surface or lines of a geometry node; None for an unknown kind.

    ``name`` is the name of the file; ``left_out`` counts what contradicts the rest.
    """
    make = MAKERS.get(node.kind)
    if make is not None and _is_empty(node):
        left_out[f"{node.kind} without a size"] += 1
        return MeshSurface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    return None if make is None else make(node, name, left_out)


def _is_empty(node: Node) -> bool:
    """Return whether a solid has no surface: one side may be 0, as of a plate."""
    if node.kind not in LENGTHS:
        return False
    lengths = np.concatenate([numbers(node, name, (1.0,))[:, 0] for name in LENGTHS[node.kind]])
    radius = node.kind != "Box" and not float(lengths[0]) > 0.0
    return radius or bool((lengths < 0.0).any()) or int((lengths == 0.0).sum()) > 1
