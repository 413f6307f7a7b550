"""COLLADA, read with pycollada, the library that trimesh uses for it too.

Source: Khronos Group, COLLADA 1.4.1 (2008). trimesh cuts concave polygons into fans, so the parts
of the scene are taken from pycollada. No entity is expanded and no other file is opened.
"""

from __future__ import annotations

import io
from itertools import chain
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser, fromstring

import numpy as np
from collada import Collada
from collada.common import DaeError
from collada.controller import BoundController, BoundSkin
from collada.geometry import BoundGeometry
from collada.material import Map
from collada.polylist import BoundPolylist
from collada.primitive import BoundPrimitive
from collada.triangleset import BoundTriangleSet

from katana450.errors import InputError
from katana450.extensions.importers.library_errors import failures_in_words
from katana450.extensions.importers.surface import (
    MAX_COPIES,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    doubles,
    of_polygons,
)
from katana450.maths.geometry.arrays import FloatArray

LEFT_OUT = {
    "skin": "bones",
    "morph": "changes of shape",
    "animation": "motion",
    "image": "pictures on the surface",
    "lines": "lines",
    "linestrips": "lines",
}
"""XML elements that are not read, and their names in messages."""

SURFACES = (BoundTriangleSet, BoundPolylist)
"""Classes of primitives that have a surface."""

X_UP = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Rotation from x up to y up."""


def read_dae(data: bytes, name: str) -> MeshReading:
    """Return all polygons of the scene. Raises InputError if the file has none."""
    root = _document(data, name)
    builder = MeshBuilder(name)
    with failures_in_words(name):
        document = Collada(io.BytesIO(data), ignore=[DaeError], aux_file_loader=_no_file)
        if document.scene is None:
            raise InputError(f"{name} shows no scene.")
        controllers = map(_base, document.scene.objects("controller"))
        for number, part in enumerate(chain(document.scene.objects("geometry"), controllers)):
            if number >= MAX_COPIES:
                raise InputError(f"{name} shows more than {MAX_COPIES} nodes.")
            for primitive in part.primitives():
                if isinstance(primitive, SURFACES) and primitive.vertex is not None:
                    builder.add(_surface(primitive, np.linalg.det(part.matrix[:3, :3]) < 0.0, name))
        surface = builder.surface()
        unit = document.assetInfo.unitmeter
        up = str(document.assetInfo.upaxis)
    left_out = [words for tag, words in LEFT_OUT.items() if root.find(f".//{{*}}{tag}") is not None]
    if document.errors:
        left_out.append(f"{len(document.errors)} corrupt parts")
    if up == "X_UP":
        surface = MeshSurface(surface.vertices @ X_UP.T, surface.faces, surface.colours)
    return MeshReading(
        surface,
        tuple(dict.fromkeys(left_out)),
        unit=1.0 if unit is None else float(unit),
        up="z" if up == "Z_UP" else "y",
    )


def _base(controller: BoundController) -> BoundGeometry:
    """Return the surface that bones or weights deform, as it is before they do."""
    if isinstance(controller, BoundSkin):
        return controller.geometry
    return controller.original.source_geometry.bind(
        controller.matrix, controller.materialnodebysymbol
    )


def _document(data: bytes, name: str) -> Element:
    """Return the root of a document without entities. Raises InputError with the line."""
    try:
        root = fromstring(data, XMLParser(target=_PlainBuilder(name)))
    except InputError:
        raise
    except (ParseError, ValueError, LookupError) as error:
        raise InputError(f"{name} is corrupt or not COLLADA: {error}.") from error
    if root.tag.rpartition("}")[2] != "COLLADA":
        raise InputError(f"{name} is not COLLADA: its root element has another name.")
    return root


class _PlainBuilder(TreeBuilder):
    """Builds the tree of a document that declares nothing."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self._file = file

    def doctype(self, *_: object) -> None:
        """Refuse the document, before any entity of it is expanded."""
        raise InputError(f"{self._file} declares XML entities, which are not supported.")


def _no_file(_path: str) -> None:
    """Return None for every other file that the file refers to."""


def _surface(primitive: BoundPrimitive, is_mirrored: bool, name: str) -> MeshSurface:
    corners = np.asarray(primitive.vertex_index, dtype=np.int64)
    sizes = np.full(len(corners), 3)
    if isinstance(primitive, BoundPolylist):
        sizes = np.diff(np.asarray(primitive.polyindex, dtype=np.int64).reshape(-1, 2)).ravel()
    corners = corners.ravel()
    if (sizes < 0).any() or sizes.sum() != len(corners):
        raise InputError(f"{name} is corrupt: its polygons do not have the corners they declare.")
    surface = of_polygons(
        doubles(primitive.vertex).reshape(-1, 3),
        corners,
        sizes,
        name,
        corner_colours=_colours(primitive, len(corners), name),
    )
    if is_mirrored:
        return MeshSurface(surface.vertices, surface.faces[:, ::-1], surface.colours)
    return surface


def _colours(primitive: BoundPrimitive, count: int, name: str) -> FloatArray | None:
    """Return (count, 4) 0..1, colours of the corners or of the material; None without colours.

    Every surface is opaque, because programs disagree on the meaning of opacity in COLLADA.
    """
    listed = primitive.original.sources.get("COLOR")
    if listed:
        offset, *_, source = listed[0]
        colours = doubles(source.data)[np.asarray(primitive.index)[..., offset].ravel()]
    else:
        effect = getattr(primitive.material, "effect", None)
        diffuse = getattr(effect, "diffuse", None)
        if diffuse is None or isinstance(diffuse, Map):
            return None
        colours = np.tile(np.asarray(diffuse, dtype=np.float64), (count, 1))
    if colours.ndim != 2 or colours.shape[1] < 3 or len(colours) != count:
        raise InputError(f"{name} is corrupt: the colours do not match the corners.")
    return np.column_stack((colours[:, :3], np.ones(count)))
