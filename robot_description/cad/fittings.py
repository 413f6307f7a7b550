"""Fittings of several links: hubs, boxes, conduit fittings, screws, names; mm."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Literal

from manifold3d import Manifold

from robot_description.cad import conduit
from robot_description.cad.conduit import Eye, Gland
from robot_description.cad.lettering import lettering, wrapped
from robot_description.cad.material import ALUMINIUM, BLUE, BRIGHT, PLASTIC, STEEL
from robot_description.cad.outline import circle, segments_of
from robot_description.cad.part import Part
from robot_description.cad.solid import (
    Direction,
    Point,
    Range,
    aimed,
    around,
    ball,
    block,
    lathe,
    placed,
    prism,
    rod,
)

Sideways = Literal["+y", "-y"]

SCREW_HEAD_HEIGHT = 1.6
SOCKET_FRACTION = 0.5  # of the head's diameter
GLAND_NUT = 18.0  # across flats
SLEEVE_DIAMETER, SLEEVE_MOUTH, SLEEVE_NECK = 19.6, 14.4, 7.0
EYE_DIAMETER = 22.0
DISC_EDGE, DISC_GAP = 4.0, 1.4
STAR_SCREWS, STAR_CIRCLE, STAR_SCREW = 6, 0.26, 0.19  # count; fractions of the cap's diameter
LETTER_STANDS = 0.2
BORE_CLEARANCE, BORE_SEGMENTS = 1.0, 24  # on the diameter
SEAM_WIDTH, SEAM_STANDS = 0.8, 0.1


def screws(part: Part, points: Iterable[Point], toward: Direction, head: float) -> None:
    """Add socket screws with heads of diameter ``head`` at ``points`` of a surface."""
    for at in points:
        part.add(
            STEEL,
            lathe(
                [(-0.8, head / 2, 0.0), (SCREW_HEAD_HEIGHT, head / 2, 0.0)], toward, at, segments=10
            ),
        )
        socket = SOCKET_FRACTION * head
        part.cut(rod(socket, SCREW_HEAD_HEIGHT - 0.9, 4.0, toward, at, segments=6), of=STEEL)


def gland(part: Part, fitting: Gland) -> None:
    """Add a swivel gland: nut, ball and the sleeve that holds the conduit."""
    nut = prism(
        circle(GLAND_NUT / 2 / math.cos(math.pi / 6), segments=6),
        -1.0,
        conduit.NUT_HEIGHT,
        (0.0, 1.0),
    )
    radius, mouth, neck = SLEEVE_DIAMETER / 2, conduit.SLEEVE_LENGTH, SLEEVE_NECK
    neck_ring = rod(2 * radius, neck - 0.5, neck, segments=16)
    body = Manifold.batch_hull([ball(GLAND_NUT - 2.5, (0.0, 0.0, 0.0), 16), neck_ring])
    sleeve = lathe(
        [
            (neck - 2.0, radius - 1.0, 0.0),
            (neck + 0.8, radius - 1.0, 0.0),
            (neck + 0.8, radius, 0.0),
            (mouth, radius, 1.2),
            (mouth, SLEEVE_MOUTH / 2, 0.0),
            (mouth - conduit.INSERTED - 1.0, SLEEVE_MOUTH / 2, 0.0),
        ],
        segments=16,
    )
    part.add(
        PLASTIC,
        placed(nut, "+y", fitting.at),
        aimed(body + sleeve, fitting.outward, fitting.swivel),
    )


def eye(part: Part, fitting: Eye, foot: Manifold) -> None:
    """Add a ring that leads the conduit upwards, on the bracket ``foot``."""
    half = conduit.EYE_HALF
    outer = rod(EYE_DIAMETER, -half, half, at=fitting.at, edge=1.4)
    bore = rod(2 * conduit.RADIUS, -half - 1.0, half + 1.0, at=fitting.at)
    part.add(PLASTIC, (outer + foot) - bore)


def _disc(low: float, high: float, diameter: float, cap: float, toward: Direction) -> Manifold:
    radius, dish = diameter / 2, cap / 2
    return lathe(
        [
            (low, radius - 3.0, 0.0),
            (low + DISC_GAP, radius - 3.0, 0.0),
            (low + DISC_GAP, radius, 1.2),
            (high, radius, DISC_EDGE),
            (high, dish + 2.6, 0.0),
            (high - 1.4, dish + 1.2, 0.0),
        ],
        toward,
    )


def hub(
    part: Part, disc: Range, diameter: float, cap: float, end: float, star: bool = False
) -> None:
    """Close a joint on both sides: a black disc over the range ``disc``, a silver cap to ``end``.

    ``diameter`` is that of the disc and ``cap`` that of the silver centre, which has a ``star`` of
    screws or a hole.
    """
    low, high = disc
    toward: Direction
    for toward in ("+y", "-y"):
        part.add(PLASTIC, _disc(low, high, diameter, cap, toward))
        hole = 0.1 * cap
        part.add(
            BRIGHT,
            lathe(
                [
                    (high - 3.0, cap / 2, 0.0),
                    (end, cap / 2, 1.2),
                    (end, hole, 0.0),
                    (end - 1.6, hole, 0.0),
                ],
                toward,
            ),
        )
        part.add(PLASTIC, rod(2.2 * hole, high - 3.0, end - 1.2, toward, segments=12))
        for u, w in around(STAR_SCREWS, STAR_CIRCLE * cap) if star else ():
            head = rod(STAR_SCREW * cap, end - 2.0, end + 0.9, toward, segments=10)
            part.add(PLASTIC, head.translate((u, 0.0, w)))


def name(part: Part, text: str, height: float, at: Point, toward: Sideways) -> None:
    """Add ``text`` along the arm at ``at`` on a surface that faces sideways."""
    flat = lettering(text, height, 2 * LETTER_STANDS).translate((0.0, 0.0, -LETTER_STANDS))
    upright = flat.rotate((90.0, 0.0, 0.0))  # faces -y, reads along +x
    part.add(BLUE, (upright if toward == "-y" else upright.rotate((0.0, 0.0, 180.0))).translate(at))


def name_round(text: str, height: float, radius: float, azimuth: float) -> Manifold:
    """Return ``text`` around a cylinder about z, centred at ``azimuth`` degrees and z 0."""
    ring = wrapped(text, height, 2 * LETTER_STANDS, radius - LETTER_STANDS)
    return ring.rotate((0.0, 0.0, azimuth))


def bored(part: Part, diameter: float, half_length: float, x: float = 0.0) -> None:
    """Bore ``part`` about the axis y at ``x`` for a shaft, to ``half_length`` on both sides."""
    reach = half_length
    part.cut(
        rod(
            diameter + BORE_CLEARANCE,
            -reach,
            reach,
            "+y",
            (x, 0.0, 0.0),
            segments=BORE_SEGMENTS,
        )
    )


def seam(radius: float, at: float, widest: float, toward: Direction = "+z") -> Manifold:
    """Return the dark line of a joint around a turned part at height ``at`` along ``toward``.

    ``widest`` is the part's largest radius. The line has as many chords as the part, so the two
    never intersect.
    """
    low, high = at - SEAM_WIDTH / 2, at + SEAM_WIDTH / 2
    return rod(2 * (radius + SEAM_STANDS), low, high, toward, segments=segments_of(widest))


def terminal_box(part: Part, x: Range, y: Range, z: Range, glands: Iterable[Gland]) -> None:
    """Add a box with a lid and screws towards +y and its ``glands``; a deep box has a second seam.

    The seams show the dark core under the shells.
    """
    gap = 0.8
    lid, edge = y[1] - 3.2, 1.2
    parting = [y[0] + 0.62 * (lid - y[0])] if lid - y[0] > 40.0 else []
    for low, high in pairwise([y[0] - gap, *parting, lid - gap]):
        part.add(ALUMINIUM, block(x, (low + gap, high), z, edge))
    core = 0.9
    part.add(
        STEEL,
        block((x[0] + core, x[1] - core), (y[0] + 3.0, y[1] - 1.0), (z[0] + core, z[1] - core)),
    )
    part.add(ALUMINIUM, block(x, (lid, y[1]), z, 0.8))
    inner = [(u, w) for u in (x[0] + 3.4, x[1] - 3.4) for w in (z[0] + 3.4, z[1] - 3.4)]
    screws(part, [(u, y[1], w) for u, w in inner], "+y", 3.6)
    for each in glands:
        gland(part, each)


def plug(part: Part, at: Point, toward: Direction, diameter: float) -> None:
    """Add a round panel connector with a knurled ring and a dark face."""
    radius = diameter / 2
    part.add(
        BRIGHT,
        lathe(
            [(-1.0, radius, 0.0), (3.6, radius, 0.6), (3.6, radius - 1.6, 0.0)],
            toward,
            at,
            segments=20,
        ),
    )
    part.cut(placed(prism(circle(radius - 1.6, segments=16), 2.2, 6.0), toward, at), of=BRIGHT)
    part.add(PLASTIC, rod(diameter - 2.4, -0.5, 2.4, toward, at, segments=16))
