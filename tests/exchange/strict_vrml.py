"""A reader of VRML97 that refuses whatever an export of this project lacks."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import HEADER, KEYWORDS, Node, Use, Value, World
from katana450.extensions.importers.formats.vrml_reader import Reader
from katana450.maths.geometry import se3, so3
from tests.exchange.vrml_types import FIELDS, LISTS, WIDTHS, Type


def read_world(text: str) -> World:
    """Return the content of a file. Raises InputError, with the line of an error in a node."""
    if not re.match(f"{re.escape(HEADER)}(?![^ \r\n])", text):
        raise InputError(f"A world must begin with {HEADER!r}.")
    return StrictReader(text, "The file").world()


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


class StrictReader(Reader):
    """A reader of the nodes of exports, with references as they are written."""

    def world(self) -> World:
        """Return the content of the file. Raises InputError with the line of an error."""
        content = self.nodes()
        nodes = tuple(node for node in content if isinstance(node, Node))
        if len(nodes) < len(content):
            raise self._error("USE is not allowed at the top level")
        return World(nodes)

    def _body(self, kind: str, name: str | None, depth: int) -> Node:
        if kind not in FIELDS:
            raise self._error(f"the node {kind!r} is not supported")
        if name in self._named:
            raise self._error(f"{name!r} is defined twice")
        if name in KEYWORDS:
            raise self._error(f"{name!r} is not a name")
        node = super()._body(kind, name, depth)
        for field, value in node.fields:
            self._check(node.kind, field, value)
        return node

    def _check(self, kind: str, field: str, value: Value) -> None:
        """Refuse a field that exports do not write, and numbers that do not have its type."""
        if field not in FIELDS[kind]:
            raise self._error(f"{kind} has no field {field!r}")
        type_ = FIELDS[kind][field]
        numbers = value if isinstance(value, tuple | list) else (value,)
        if type_ is Type.BOOL and not isinstance(value, bool):
            raise self._error(f"{field} is not TRUE or FALSE")
        if isinstance(value, list) and type_ not in LISTS:
            raise self._error(f"{field} is not a list")
        if type_ not in WIDTHS:
            return
        if not all(isinstance(number, float | int) for number in numbers):
            raise self._error(f"{field} is not of numbers")
        if len(numbers) % WIDTHS[type_] or (type_ not in LISTS and len(numbers) != WIDTHS[type_]):
            raise self._error(f"{field} does not form rows of {WIDTHS[type_]}")
        if type_ in (Type.INT, Type.INT_LIST) and any(int(number) != number for number in numbers):  # type: ignore[arg-type]
            raise self._error(f"{field} is not of whole numbers")

    def _used(self, name: str) -> Use:
        super()._used(name)
        return Use(name)
