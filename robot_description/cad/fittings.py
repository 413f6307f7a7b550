"""What several links carry alike: hubs, terminal boxes, cable glands, screws; mm."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from robot_description.cad.lettering import lettering
from robot_description.cad.material import ALUMINIUM, BLUE, BRIGHT, PLASTIC, RUBBER, STEEL
from robot_description.cad.outline import octagon
from robot_description.cad.part import Part
from robot_description.cad.solid import Direction, Point, Range, block, lathe, placed, prism, rod

Sideways = Literal["+y", "-y"]

SCREW_HEAD_HEIGHT = 1.6
SOCKET_SHARE = 0.5  # of the head's diameter
GLAND_NUT = 15.0  # diameter
GLAND_NUT_HEIGHT = 4.0
HOSE_RIB, HOSE_GROOVE = 12.0, 9.6  # diameters
HOSE_PITCH = 3.2
DISC_EDGE = 2.6
LETTER_STANDS = 0.2
BORE_CLEARANCE = 0.6  # on the diameter


def screws(part: Part, points: Iterable[Point], toward: Direction, head: float) -> None:
    """Set socket screws with heads of diameter ``head`` on a surface at ``points``."""
    for at in points:
        part.add(
            STEEL,
            lathe(
                [(-0.8, head / 2, 0.0), (SCREW_HEAD_HEIGHT, head / 2, 0.0)], toward, at, segments=12
            ),
        )
        socket = SOCKET_SHARE * head
        part.cut(rod(socket, SCREW_HEAD_HEIGHT - 0.9, 4.0, toward, at, segments=6), of=STEEL)


def gland(part: Part, at: Point, toward: Direction, ribs: int) -> None:
    """Set a cable gland with the first ``ribs`` ribs of its corrugated hose on a surface."""
    part.add(
        PLASTIC,
        placed(prism(octagon(GLAND_NUT), -1.0, GLAND_NUT_HEIGHT, (0.0, 0.8)), toward, at),
    )
    profile = []
    for k in range(ribs):
        start = GLAND_NUT_HEIGHT - 0.5 + k * HOSE_PITCH
        for share, diameter in ((0.0, HOSE_GROOVE), (0.5, HOSE_RIB)):
            profile.append((start + share * HOSE_PITCH, diameter / 2, 0.0))
    profile.append((GLAND_NUT_HEIGHT - 0.5 + ribs * HOSE_PITCH, HOSE_GROOVE / 2, 0.0))
    part.add(RUBBER, lathe(profile, toward, at, segments=14))


def hub(part: Part, disc: Range, diameter: float, cap: float, end: float) -> None:
    """Close a joint on both sides: a black disc over the range ``disc``, a silver cap to ``end``.

    ``diameter`` is the disc's and ``cap`` the silver centre's.
    """
    low, high = disc
    toward: Direction
    for toward in ("+y", "-y"):
        part.add(
            PLASTIC,
            lathe(
                [
                    (low, diameter / 2, 0.0),
                    (high, diameter / 2, DISC_EDGE),
                    (high, cap / 2 + 5.0, 0.0),
                    (high - 1.2, cap / 2 + 3.4, 0.0),
                ],
                toward,
            ),
        )
        part.add(BRIGHT, rod(cap, high - 3.0, end, toward, edge=1.0))
        part.cut(rod(0.2 * cap, end - 2.0, end + 1.0, toward, segments=12), of=BRIGHT)
        part.add(STEEL, rod(0.3 * cap, end - 3.0, end - 1.4, toward, segments=12))


def name(part: Part, text: str, height: float, at: Point, toward: Sideways) -> None:
    """Letter ``text`` along the arm on a surface at ``at`` that faces sideways."""
    flat = lettering(text, height, 2 * LETTER_STANDS).translate((0.0, 0.0, -LETTER_STANDS))
    upright = flat.rotate((90.0, 0.0, 0.0))  # faces -y, reads along +x
    part.add(BLUE, (upright if toward == "-y" else upright.rotate((0.0, 0.0, 180.0))).translate(at))


def bored(part: Part, diameter: float, half_length: float, x: float = 0.0) -> None:
    """Bore everything there about the axis y at ``x`` for a shaft, out to both ``half_length``."""
    reach = half_length
    part.cut(rod(diameter + BORE_CLEARANCE, -reach, reach, "+y", (x, 0.0, 0.0)))


def terminal_box(
    part: Part, x: Range, y: Range, z: Range, glands: Iterable[float], ribs: int
) -> None:
    """Add a box with a lid and screws towards +y and a cable gland at each x of ``glands``."""
    seam = 2.4
    part.add(ALUMINIUM, block(x, (y[0], y[1] - seam - 0.7), z, 1.2))
    part.add(
        STEEL, block((x[0] + 0.8, x[1] - 0.8), (y[0] + 3.0, y[1] - 1.0), (z[0] + 0.8, z[1] - 0.8))
    )
    part.add(ALUMINIUM, block(x, (y[1] - seam, y[1]), z, 0.8))
    inner = [(u, w) for u in (x[0] + 3.6, x[1] - 3.6) for w in (z[0] + 3.6, z[1] - 3.6)]
    screws(part, [(u, y[1], w) for u, w in inner], "+y", 3.6)
    for u in glands:
        gland(part, (u, y[1], 0.0), "+y", ribs)
