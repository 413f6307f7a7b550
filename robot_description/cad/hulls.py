"""Collision shapes: each link is cut into slabs along chosen planes, and each slab gets its hull.

A single hull per link would fill its forks. The planes are at changes of a link's outline, so that
each hull is near the solid. Fork cheeks are cut apart sideways. Dimensions are in mm, in the link's
frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from robot_description.cad.build import MESHES, MILLIMETRE, PARTS, Built
from robot_description.cad.part import Part
from robot_description.cad.shoulder import RING_FOOT
from robot_description.cad.solid import Axis

COLLISION = MESHES.parent / "collision"

NORMALS: dict[Axis, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}


@dataclass(frozen=True)
class Cut:
    """Parallel planes across a solid, with further cuts of the pieces between them.

    Attributes:
        axis: the planes are perpendicular to it.
        planes: their positions [mm], rising; n planes make n + 1 pieces.
        pieces: further cuts by the piece's number, counted from 0 along the axis.
        enclosed: numbers of the pieces that a neighbour's hull encloses at every joint angle. They
            get no hull, because nothing else can reach them. Programs that check a link on the
            table against its child would otherwise always find a contact of the two.
    """

    axis: Axis
    planes: tuple[float, ...]
    pieces: Mapping[int, Cut] = field(default_factory=dict)
    enclosed: frozenset[int] = frozenset()


UNCUT = Cut("x", ())

CUTS: dict[str, Cut] = {
    # Flange | drum with its connector panel and its saddle.
    "base_link": Cut("z", (11.05,)),
    # Flange | ring and connector, cable box | column and collar; beside them the gland.
    "arm_base_link": Cut("y", (61.9,), {0: Cut("z", (18.9, 42.1), {1: Cut("y", (46.0,))})}),
    # Right disc | neck in the bore of the column, ring and skirt, below the two cheeks | eye, below
    # the left disc.
    "pan_link": Cut(
        "y",
        (-49.2, 51.75),
        {
            1: Cut("z", (RING_FOOT, -29.5), {2: Cut("y", (0.0,))}, enclosed=frozenset({0})),
            2: Cut("z", (-38.0,)),
        },
    ),
    # Bellows on their shaft | tube | terminal box | tube | elbow cover on its shaft; two glands.
    "upper_arm_link": Cut(
        "y", (52.2,), {0: Cut("x", (43.3, 74.9, 117.1, 153.3)), 1: Cut("x", (96.0,))}
    ),
    # The fork, from right to left: disc, cheek, web, cheek, disc beside terminal box and, beyond
    # them, two glands | tube | wrist cover on its shaft.
    "forearm_link": Cut(
        "x",
        (77.2, 105.0),
        {
            0: Cut(
                "y",
                (-38.8, -26.8, 26.8, 37.2, 78.7),
                {4: Cut("x", (28.5,)), 5: Cut("x", (49.0,))},
            )
        },
    ),
    # The fork: disc, cheek, cheek, disc beside terminal box, gland | housing | bumper.
    "wrist_link": Cut(
        "x",
        (62.0, 101.0),
        {0: Cut("y", (-31.3, 0.0, 29.7, 73.2), {3: Cut("x", (30.4,))})},
    ),
    # Plate and root of the fork | its two prongs | bridge.
    "gripper_link": Cut("x", (26.0, 42.1), {1: Cut("z", (0.0,))}),
    # Lug with its crown, foot | strip to its first, second bend | tip.
    "finger_right_link": Cut("x", (9.6, 48.0, 63.0), {0: Cut("y", (12.0,))}),
    "finger_left_link": Cut("x", (9.6, 48.0, 63.0), {0: Cut("y", (-12.0,))}),
}
"""Cuts by link. A change of a link's outline can need another plane here; a test shows where."""


def whole(part: Part) -> Manifold:
    """Return all bodies of ``part`` as one solid."""
    return reduce(lambda a, b: a + b, (body for _, body in part.bodies()))


def pieces(solid: Manifold, cut: Cut) -> list[Manifold]:
    """Return the pieces of ``solid`` in the order of the planes, except empty and enclosed ones."""
    found: list[Manifold] = []
    rest = solid
    for number, plane in enumerate((*cut.planes, None)):
        here = rest
        if plane is not None:
            rest, here = rest.split_by_plane(NORMALS[cut.axis], plane)
        if number in cut.pieces:
            found += pieces(here, cut.pieces[number])
        elif number not in cut.enclosed and not here.is_empty():
            found.append(here)
    return found


def hulls_of(part: Part) -> list[Manifold]:
    """Return the hulls of ``part``; together they contain all of it that is not enclosed."""
    return [piece.hull() for piece in pieces(whole(part), CUTS.get(part.link, UNCUT))]


def build_hulls(folder: Path = COLLISION) -> Iterator[Built]:
    """Write every hull as binary STL in metres into ``folder``, in place of its old files."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.stl"):
        old.unlink()
    for make in PARTS:
        part = make()
        yield from write_hulls(part.link, hulls_of(part), folder)


def write_hulls(link: str, hulls: Iterable[Manifold], folder: Path) -> Iterator[Built]:
    """Write each of the ``hulls`` of ``link`` as binary STL in metres into ``folder``."""
    for number, hull in enumerate(hulls):
        data = _stl_bytes(hull)
        path = folder / f"{link}_{number}.stl"
        path.write_bytes(data)
        yield Built(path, 0, hull.num_tri(), len(data))


def with_collisions(urdf: str, folder: Path = COLLISION) -> str:
    """Return the text of a URDF with the hulls in ``folder`` as collision shapes of its links."""

    def shaped(link: re.Match[str]) -> str:
        files = sorted(folder.glob(f"{link['name']}_[0-9]*.stl"), key=_number)
        return link[0] + "".join(
            f'\n    <collision><geometry><mesh filename="{folder.name}/{file.name}"/></geometry>'
            "</collision>"
            for file in files
        )

    bare = re.sub(r"\n *<collision.*?</collision>", "", urdf, flags=re.DOTALL)
    start = r'<link name="(?P<name>[^"]+)">(\s*<visual>.*?</visual>)*'
    return re.sub(start, shaped, bare, flags=re.DOTALL)


def _number(file: Path) -> int:
    return int(file.stem.rpartition("_")[2])


def _stl_bytes(hull: Manifold) -> bytes:
    mesh = hull.to_mesh64()
    corners = np.asarray(mesh.vert_properties)[:, :3] * MILLIMETRE
    triangles = corners[np.asarray(mesh.tri_verts, dtype=np.int64)]
    facets = np.zeros(len(triangles), dtype=[("values", "<f4", (4, 3)), ("attribute", "<u2")])
    # Facet normals are zero, so that readers compute them from the corners.
    facets["values"][:, 1:] = triangles
    return b"".join((bytes(80), np.array(len(facets), "<u4").tobytes(), facets.tobytes()))
