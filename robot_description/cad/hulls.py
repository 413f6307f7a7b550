"""Collision shapes: every link cut into slabs along chosen planes, each slab replaced by its hull.

One hull a link would fill its forks. The planes are chosen where a link changes its outline, so
that each hull stays near the solid; fork cheeks are cut apart sideways. mm, in the link's frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from robot_description.cad.build import MESHES, MILLIMETRE, PARTS, Built
from robot_description.cad.part import Part
from robot_description.cad.solid import Axis

COLLISION = MESHES.parent / "collision"

NORMALS: dict[Axis, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}


@dataclass(frozen=True)
class Cut:
    """Parallel planes across a solid, and the pieces between them that are cut further.

    Attributes:
        axis: the planes are square to it.
        planes: where they are [mm], rising; n planes make n + 1 pieces.
        pieces: further cuts by the piece's number, counted from 0 along the axis.
    """

    axis: Axis
    planes: tuple[float, ...]
    pieces: Mapping[int, Cut] = field(default_factory=dict)


UNCUT = Cut("x", ())

CUTS: dict[str, Cut] = {
    # Flange | drum and connector panel | the rim's two horns.
    "base_link": Cut("z", (8.2, 69.5), {1: Cut("y", (-72.1,)), 2: Cut("y", (0.0,))}),
    # Flange | connector, ring, cable box and gland | column and collar.
    "arm_base_link": Cut("z", (13.7, 42.3), {1: Cut("x", (-46.0,), {1: Cut("y", (46.0, 60.0))})}),
    # Neck and skirt | right disc, right cheek, left cheek, left disc.
    "pan_link": Cut("z", (-44.4,), {1: Cut("y", (-49.2, 0.0, 49.2))}),
    # Bellows on their shaft | tube | terminal box and its glands | tube | elbow cover on its shaft.
    "upper_arm_link": Cut(
        "x", (43.0, 74.0, 118.0, 154.0), {2: Cut("y", (52.2,), {1: Cut("x", (96.0,))})}
    ),
    # The fork, from right to left: disc, cheek, web, cheek, disc beside terminal box and glands |
    # tube | wrist cover on its shaft.
    "forearm_link": Cut(
        "x",
        (77.2, 105.0),
        {
            0: Cut(
                "y",
                (-38.8, -26.8, 26.8, 37.2),
                {4: Cut("x", (29.0,), {1: Cut("y", (78.7,), {1: Cut("x", (49.0,))})})},
            )
        },
    ),
    # The fork, as above | housing | bumper.
    "wrist_link": Cut(
        "x",
        (62.0, 101.0),
        {0: Cut("y", (-31.3, 0.0, 29.7), {3: Cut("x", (30.0,), {1: Cut("y", (73.2,))})})},
    ),
    # Cylinder | dome.
    "roll_link": Cut("z", (22.2,)),
    # Plate | root of the fork | its two prongs.
    "gripper_link": Cut("x", (2.5, 22.0), {2: Cut("z", (0.0,))}),
    # Lug beside the root of the strip | strip to its first, second bend | tip.
    "finger_right_link": Cut("x", (20.0, 48.0, 63.0), {0: Cut("z", (6.0,))}),
    "finger_left_link": Cut("x", (20.0, 48.0, 63.0), {0: Cut("z", (-6.0,))}),
}
"""By link: a change of its outline asks for another plane here, and a test says where."""


def whole(part: Part) -> Manifold:
    """Return everything of ``part`` as one solid."""
    return reduce(lambda a, b: a + b, (body for _, body in part.bodies()))


def pieces(solid: Manifold, cut: Cut) -> list[Manifold]:
    """Return ``solid`` cut apart, in the order of the planes; empty pieces are left out."""
    found: list[Manifold] = []
    rest = solid
    for number, plane in enumerate((*cut.planes, None)):
        here = rest
        if plane is not None:
            rest, here = rest.split_by_plane(NORMALS[cut.axis], plane)
        if number in cut.pieces:
            found += pieces(here, cut.pieces[number])
        elif not here.is_empty():
            found.append(here)
    return found


def hulls_of(part: Part) -> list[Manifold]:
    """Return the hulls of ``part``: together they hold all of it."""
    return [piece.hull() for piece in pieces(whole(part), CUTS.get(part.link, UNCUT))]


def build_hulls(folder: Path = COLLISION) -> Iterator[Built]:
    """Write every hull as binary STL in metres into ``folder``, and take away what was there."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.stl"):
        old.unlink()
    for make in PARTS:
        part = make()
        for number, hull in enumerate(hulls_of(part)):
            data = _stl_bytes(hull)
            path = folder / f"{part.link}_{number}.stl"
            path.write_bytes(data)
            yield Built(path, 0, hull.num_tri(), len(data))


def with_collisions(urdf: str, folder: Path = COLLISION) -> str:
    """Return the text of a URDF with the hulls in ``folder`` as the shapes of its links."""

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
    # A facet's normal is left zero, which readers take from its corners.
    facets["values"][:, 1:] = triangles
    return b"".join((bytes(80), np.array(len(facets), "<u4").tobytes(), facets.tobytes()))
