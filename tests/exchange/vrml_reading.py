"""Worlds of exports, read back with their references, and the poses of their nodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from katana450.extensions.export.vrml.vrml_world import HEADER, Node, Use, World
from katana450.extensions.importers.formats.vrml_reader import Reader
from katana450.maths.geometry import se3, so3


def read_world(text: str) -> World:
    """Return the content of a file. Raises InputError, with the line of an error in a node."""
    assert text.startswith(f"{HEADER}\n")
    nodes = ExportReader(text, "The file").nodes()
    return World(tuple(node for node in nodes if isinstance(node, Node)))


Matrix = npt.NDArray[np.float64]


def numbers_of(node: Node, field: str, default: tuple[float, ...]) -> Matrix:
    """Return a field of numbers."""
    value = node.get(field)
    return np.array(default if value is None else value, dtype=float)


def placed_nodes(world: World) -> Iterator[tuple[Node, str, Matrix]]:
    """Yield each node, its name or that of the nearest named group, and its pose (4, 4)."""

    def visit(node: Node, T: Matrix, name: str) -> Iterator[tuple[Node, str, Matrix]]:
        name = node.name if node.name is not None and node.kind in ("Transform", "Group") else name
        if node.kind == "Transform":
            # ISO/IEC 14772-1, 6.52: P' = T C R -C P.
            centre, moved = (numbers_of(node, key, (0.0,) * 3) for key in ("center", "translation"))
            x, y, z, angle = numbers_of(node, "rotation", (0.0, 0.0, 1.0, 0.0))
            step = se3.from_rotation_translation(so3.exp(angle * np.array((x, y, z))), moved)
            step[:3, 3] += centre - step[:3, :3] @ centre
            T = T @ step
        yield node, name, T
        for _, value in node.fields:
            for part in value if isinstance(value, list) else (value,):
                if isinstance(part, Node):
                    yield from visit(part, T, name)

    for top in world.nodes:
        yield from visit(top, np.eye(4), "")


class ExportReader(Reader):
    """A reader that keeps references as they are written."""

    def _used(self, name: str) -> Use:
        super()._used(name)
        return Use(name)
