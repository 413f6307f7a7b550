"""An SO-101: printed brackets around six servos, drawn about the joints of its URDF; mm.

Links up to the wrist are drawn at zero in axes of the base: x forward, y left, z up. The two jaws
are drawn at the horn of the fifth servo, level and closed. Each printed piece is near its convex
hull, so the hulls of pieces and servos are the collision shapes.
"""

from __future__ import annotations

import functools
import math
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yourdfpy
from manifold3d import Manifold
from numpy.typing import NDArray

from katana450.resources import INCLUDED
from robot_description.cad.build import MESHES, MILLIMETRE, Built, write_glb
from robot_description.cad.hulls import COLLISION, with_collisions, write_hulls
from robot_description.cad.mass import inertial, moments_of, with_inertials
from robot_description.cad.material import PANEL, PLASTIC, PRINT, SERVO, STEEL, Material
from robot_description.cad.outline import Outline, circle, hull, on_grid, rectangle, rounded
from robot_description.cad.part import Part
from robot_description.cad.solid import Point, Range, around, block, prism, rod

URDF = INCLUDED["so101"]
BASE, HAND, JAW = "base_link", "gripper_link", "moving_jaw_so101_v1_link"

BACK, END = -35.1, 10.1
"""Ends of the body of an STS3215, from its axis."""
WIDTH, HEIGHT = 12.35, 15.2
"""Half the width of the body, and half its height along the axis."""
HORN, CHEEK = 18.3, 22.0
"""Distance of both horns from the middle of a servo, and that of the outer faces of the cheeks."""
WALL = 17.8
"""Distance of the outer faces of what turns between two cheeks."""
EYE, EDGE, THICK = 13.0, 1.2, 3.6
"""Radius of a cheek about its axis, rounding of the edges, and thickness of a wall."""
TIP, FACE = 101.0, -7.9
"""End of the fixed jaw, and height of its inner face over the axis of the horn."""

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ACROSS: Range = (-CHEEK, CHEEK)
BETWEEN: Range = (-WALL, WALL)

HAND_AXES = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
"""Pose (4, 4) of the drawing axes of the jaws in the frame of the gripper, which looks along -z."""


class DrawnLink(NamedTuple):
    """A link with its convex collision shapes, both in its frame."""

    part: Part
    hulls: tuple[Manifold, ...]


@functools.cache
def _closed_robot() -> yourdfpy.URDF:
    robot = yourdfpy.URDF.load(str(URDF), load_meshes=False)
    robot.update_cfg({"gripper": robot.joint_map["gripper"].limit.lower})
    return robot


def _pose(link: str, base: str = BASE) -> NDArray[np.float64]:
    """Return the pose (4, 4) of ``link`` in ``base`` at zero with closed jaws."""
    T = np.array(_closed_robot().get_transform(link, base), dtype=np.float64)
    T[:3, 3] /= MILLIMETRE
    return T


def _servo(at: Point, axis: Point, back: Point) -> Manifold:
    """Return the servo whose middle on its axis is ``at``, and whose body extends to ``back``."""
    x = -np.array(back)
    body = prism(rectangle((BACK, END), (-WIDTH, WIDTH), 2.0), -HEIGHT, HEIGHT, 1.0)
    within = rectangle((BACK + 0.5, END - 0.5), (0.5 - WIDTH, WIDTH - 0.5), 1.6)
    seam = block((-40.0, 20.0), (-20.0, 20.0), (8.2, 8.7)) - prism(within, 8.0, 9.0)
    solid = body - seam - seam.translate((0.0, 0.0, -16.9)) + rod(20.0, -HORN, HORN, edge=0.8)
    return solid.transform(np.column_stack((x, np.cross(axis, x), axis, at)))


def _link(
    name: str,
    pieces: Sequence[Manifold],
    cuts: Sequence[Manifold],
    others: Mapping[Material, Manifold],
    base: str = BASE,
) -> DrawnLink:
    """Return the link of printed ``pieces`` without ``cuts``, and of ``others``."""
    axes = HAND_AXES if base == HAND else np.eye(4)
    place = on_grid((np.linalg.inv(_pose(name, base)) @ axes)[:3])
    part = Part(name)
    part.add(PRINT, *(piece.transform(place) for piece in pieces))
    part.cut(*(cut.transform(place) for cut in cuts))
    for material, solid in others.items():
        part.add(material, solid.transform(place))
    bodies = [*pieces, *(solid for material, solid in others.items() if material is SERVO)]
    return DrawnLink(part, tuple(body.transform(place).hull() for body in bodies))


def _cheeks(outline: Outline) -> list[Manifold]:
    """Return the cheeks of ``outline`` (x, z) on both horns of a servo along y."""
    return [prism(outline, *side, 0.8, "y") for side in ((-CHEEK, -HORN), (HORN, CHEEK))]


def _screws(x: float, z: float) -> Manifold:
    """Return the heads of the screws in both cheeks about the axis at ``x`` and ``z``."""
    heads = [(0.0, 0.0, 5.0), *((u, w, 3.2) for u, w in around(4, 7.0, math.pi / 4.0))]
    rods = [
        rod(size, CHEEK - 1.0, CHEEK + 0.9, side, (x + u, 0.0, z + w), 0.3, 12)
        for side in ("+y", "-y")
        for u, w, size in heads
    ]
    return Manifold.compose(rods)


def _holes(x: float, heights: Range) -> list[Manifold]:
    """Return two rows of blind holes in a face at ``x``."""
    return [rod(3.0, -1.5, 1.5, "+x", (x, y, z)) for y in (-12.0, -4.0, 4.0, 12.0) for z in heights]


def base_link() -> DrawnLink:
    """Return the foot with two wings for clamps, the tower of the first servo, and the board."""
    x, _, z = _pose("shoulder_link")[:3, 3]
    front, places = x + 15.0, [(4.0, 40.0, 0.0), (4.0, -40.0, 0.0)]
    foot = prism(rectangle((-36.0, front), (-21.0, 21.0), 5.0), 0.0, 6.0, EDGE)
    bar = prism(rectangle((-8.0, 16.0), (-38.0, 38.0), 3.0), 0.0, 6.0, EDGE)
    wing = prism(hull(circle(16.0), rectangle((-17.0, 17.0), (-10.0, 10.0), 3.0)), 0.0, 9.0, EDGE)
    tower = prism(rectangle((-2.0, front), (-20.0, 20.0), 4.0), 4.0, z - 5.0, EDGE)
    sides = [block((-33.0, 0.0), side, (4.0, 40.0), 0.8) for side in ((-20.0, -17.0), (17.0, 20.0))]
    cuts = [prism(rectangle((10.0, 44.0), (32.0, 52.0), 4.0), -30.0, 30.0, axis="y")]
    for u, v in around(6, 10.0):
        hole = rod(4.5, -1.0, 12.0, "+z", (u, v, 0.0), segments=12)
        cuts += [hole.translate(place) for place in places]
    plugs = [
        block((-27.0, -20.0), (y, y + 8.0), (low, low + 8.0), 0.8)
        for y, low in ((-12.0, 10.0), (4.0, 10.0), (-4.0, 26.0))
    ]
    others = {
        SERVO: _servo((x, 0.0, z - HORN), Z, (-1.0, 0.0, 0.0)),
        PLASTIC: block((-20.0, -18.0), (-16.9, 16.9), (7.0, 44.0)),
        PANEL: Manifold.compose(plugs),
    }
    wings = [wing.translate(place) for place in places]
    cuts += _holes(front, (14.0, 22.0))
    return _link(BASE, [foot, bar, tower, *wings, *sides], cuts, others)


def shoulder_link() -> DrawnLink:
    """Return the plate on the first horn and the bracket of the second servo."""
    x, _, z = _pose("shoulder_link")[:3, 3]
    axis, _, height = _pose("upper_arm_link")[:3, 3]
    front, low = axis + WIDTH + THICK, height + BACK
    corners = [(x - 19.0, z, 2.0), (front, z, 4.0), (front, low + 5.0, 1.5)]
    corners += [(x - 10.0, low + 5.0, 4.0), (x - 19.0, low - 6.0, 2.0)]
    floor = prism(rounded(corners), *BETWEEN, EDGE, "y")
    plate = rod(35.0, z, z + 6.0, "+z", (x, 0.0, 0.0), EDGE)
    bracket = block((axis - WIDTH - THICK, front), BETWEEN, (low - 2.0, height - 17.0), EDGE)
    servo = _servo((axis, 0.0, height), Y, (0.0, 0.0, -1.0))
    holes = _holes(front, (low + 2.0, low + 9.0))
    return _link("shoulder_link", [floor, plate, bracket], holes, {SERVO: servo})


def upper_arm_link() -> DrawnLink:
    """Return the arch on the second servo, and on it the bracket of the third."""
    x, _, z = _pose("upper_arm_link")[:3, 3]
    elbow, _, top = _pose("lower_arm_link")[:3, 3]
    floor, rear = top - WIDTH - THICK, elbow + BACK - THICK
    depth = (rear, x + 10.0)
    pieces = _cheeks(hull(circle(EYE, (x, z)), rectangle(depth, (z + 40.0, z + 50.0))))
    pieces += [
        prism(rectangle(depth, (z + 34.0, z + 62.0), 2.0), *ACROSS, EDGE, "y"),
        prism(rectangle(depth, (z + 52.0, floor + 4.0), 2.0), *BETWEEN, EDGE, "y"),
        block((rear, elbow - EYE), BETWEEN, (floor, top + WIDTH + THICK), EDGE),
    ]
    arch = hull(rectangle((-HORN, HORN), (z, z + 20.0)), circle(HORN, (0.0, z + 28.0)))
    slot = rectangle((-11.0, 11.0), (z + 58.0, floor - 7.0), 5.0)
    cuts = [prism(outline, 0.0, elbow, axis="x") for outline in (arch, slot)]
    cuts += [block((rear + 18.0, elbow), (-30.0, 30.0), (top - 6.0, top + 30.0))]
    cuts += _holes(rear, (top - 6.0, top + 2.0))
    servo = _servo((elbow, 0.0, top), Y, (-1.0, 0.0, 0.0))
    return _link("upper_arm_link", pieces, cuts, {SERVO: servo, STEEL: _screws(x, z)})


def lower_arm_link() -> DrawnLink:
    """Return the cheeks on the third servo, the braced beam, and the bracket of the fourth."""
    x, _, z = _pose("lower_arm_link")[:3, 3]
    wrist, _, end = _pose("wrist_link")[:3, 3]
    start, rear, height = x + 19.0, wrist + BACK - THICK, WIDTH + 3.4
    slab = ((z + end) / 2.0 - 9.5, (z + end) / 2.0 + 9.5)
    pieces = _cheeks(hull(circle(EYE, (x, z)), rectangle((start, x + 42.0), slab)))
    pieces += [
        block((start, x + 46.0), ACROSS, slab, EDGE),
        block((x + 40.0, rear + 6.0), BETWEEN, slab, EDGE),
        block((rear, wrist - 12.0), BETWEEN, (end - height, end + height), EDGE),
    ]
    left, right = x + 27.0, rear - 5.0
    triangles = [
        [(left, -5.5, 2.0), (right - 7.0, 12.5, 2.0), (left, 12.5, 2.0)],
        [(left + 7.0, -12.5, 2.0), (right, -12.5, 2.0), (right, 5.5, 2.0)],
    ]
    cuts = [prism(rounded(corners), 0.0, 400.0) for corners in triangles]
    cuts += [block((rear + 12.0, wrist - 19.0), (-10.0, 10.0), (0.0, 400.0))]
    servo = _servo((wrist, 0.0, end), Y, (-1.0, 0.0, 0.0))
    return _link("lower_arm_link", pieces, cuts, {SERVO: servo, STEEL: _screws(x, z)})


def wrist_link() -> DrawnLink:
    """Return the fork on the fourth servo, and the bracket of the fifth, which lies across."""
    x, _, z = _pose("wrist_link")[:3, 3]
    horn, y, _ = _pose(HAND)[:3, 3]
    start, stop, left = x + EYE + 5.0, horn - 9.0, y - BACK + THICK
    tall = (z - WIDTH - 3.4, z + WIDTH + 3.4)
    pieces = _cheeks(hull(circle(EYE, (x, z)), rectangle((start, x + 30.0), tall)))
    pieces += [block((start, start + 9.0), ACROSS, tall, EDGE)]
    pieces += [block((start, stop), (y - END - THICK, left), tall, EDGE)]
    window = block((horn - 27.0, stop + 1.0), (y + 4.0, left - 9.0), (0.0, 400.0))
    servo = _servo((horn - HORN, y, z), X, Y)
    return _link("wrist_link", pieces, [window], {SERVO: servo, STEEL: _screws(x, z)})


def _blade(corners: Sequence[Point], face: float) -> tuple[Manifold, list[Manifold]]:
    """Return a jaw with the side view ``corners`` (x, z, radius), and the grooves of its ``face``.

    Seen from the face, whose height is given, it is pointed.
    """
    root, tip = corners[0][0], max(x for x, _, _ in corners)
    plan = hull(rectangle((root, root + 6.0), (-16.0, 16.0), 3.0), circle(6.5, (tip - 6.5, 0.0)))
    jaw = prism(rounded(corners), *BETWEEN, 1.0, "y") ^ prism(plan, -40.0, 60.0)
    height = (face - 0.5, face + 0.5)
    return jaw, [block((x, x + 1.2), ACROSS, height) for x in np.arange(56.0, 98.0, 6.0)]


def gripper_link() -> DrawnLink:
    """Return the bracket of the sixth servo on the fifth's horn, with the fixed jaw."""
    z, _, x = _pose(JAW, HAND)[:3, 3] * (1.0, 1.0, -1.0)
    low, front = z + BACK - THICK, x + WIDTH + THICK
    corners = [(front - 9.0, low, 2.0), (48.0, low - 1.5, 9.0), (TIP, FACE - 4.0, 1.8)]
    jaw, grooves = _blade([*corners, (TIP, FACE, 1.8), (front - 9.0, FACE, 2.0)], FACE)
    back = block((0.0, x - WIDTH), BETWEEN, (low, z + 8.0), EDGE)
    cradle = block((3.0, front), BETWEEN, (low, z - 18.0), EDGE)
    servo = _servo((x, 0.0, z), Y, (0.0, 0.0, -1.0))
    return _link(HAND, [back, cradle, jaw], grooves, {SERVO: servo}, HAND)


def moving_jaw() -> DrawnLink:
    """Return the jaw that the sixth servo turns."""
    z, _, x = _pose(JAW, HAND)[:3, 3] * (1.0, 1.0, -1.0)
    # Its tip ends over the flat face of the other.
    face, root, tip = FACE + 0.5, x + EYE + 6.0, TIP - 2.0
    corners = [(root, face, 1.5), (tip, face, 1.8), (tip, face + 4.0, 1.8)]
    jaw, grooves = _blade([*corners, (58.0, face + 19.0, 9.0), (root, z - 7.0, 1.5)], face)
    arms = _cheeks(hull(circle(11.5, (x, z)), circle(7.0, (x + 24.0, z - 16.0))))
    web = block((root - 1.0, root + 11.0), ACROSS, (face + 0.5, z - 8.0), EDGE)
    return _link(JAW, [*arms, web, jaw], grooves, {STEEL: _screws(x, z)}, HAND)


ARM = (base_link, shoulder_link, upper_arm_link, lower_arm_link, wrist_link)
"""Makers of the links from the table to the wrist."""


def build_so101(folder: Path = URDF.parent) -> Iterator[Built]:
    """Write the meshes, the collision shapes and the URDF that names them into ``folder``."""
    meshes, shapes = folder / MESHES.name, folder / COLLISION.name
    for kind in (meshes, shapes):
        shutil.rmtree(kind, ignore_errors=True)
        kind.mkdir(parents=True)
    inertials = {}
    for make in (*ARM, gripper_link, moving_jaw):
        part, hulls = make()
        yield write_glb(part, meshes)
        yield from write_hulls(part.link, hulls, shapes)
        inertials[part.link] = inertial(part, moments_of(part).mass)
    text = with_collisions(URDF.read_text("utf-8"), shapes)
    (folder / URDF.name).write_text(with_inertials(text, inertials), "utf-8")
