"""upper_arm_link, forearm_link and wrist_link: thin tubes between wide forks; mm.

Each link's origin lies on the axis it turns about, x along the link, y along the axis.
"""

from __future__ import annotations

from manifold3d import Manifold

from robot_description.cad.fittings import bored, hub, name, screws, terminal_box
from robot_description.cad.material import ALUMINIUM, RUBBER
from robot_description.cad.outline import Outline, circle, fluted, hull, inset
from robot_description.cad.part import Part
from robot_description.cad.solid import Range, block, lathe, prism, rod

TUBE_DIAMETER = 34.0
CLAMP_DIAMETER, CLAMP_LENGTH = 41.0, 10.0

FLUTE_DEPTH = 2.2

UPPER_LENGTH = 190.0
SHOULDER_SHAFT, SHOULDER_SHAFT_Y = 42.0, (-37.0, 46.0)
SHOULDER_BELLOWS_RADIUS, SHOULDER_BELLOWS_HALF = 42.0, 21.3
ELBOW_SHAFT, ELBOW_SHAFT_Y = 38.0, (-47.5, 47.0)
ELBOW_COVER_RADIUS, ELBOW_COVER_HALF = 34.5, 25.8
UPPER_BOX_X, UPPER_BOX_Y, UPPER_BOX_Z = (75.0, 117.0), (-18.5, 50.5), (-19.0, 19.0)

FORE_LENGTH = 139.0
WRIST_SHAFT, WRIST_SHAFT_Y = 38.0, (-41.5, 37.5)
WRIST_COVER_RADIUS, WRIST_COVER_HALF = 33.0, 18.3
FORE_TUBE_END = 120.0
FORE_BOX_X, FORE_BOX_Y, FORE_BOX_Z = (30.5, 68.0), (36.0, 77.0), (-21.0, 21.0)

CHEEK_RADIUS, CHEEK_NOSE_RADIUS, CHEEK_THICK = 38.0, 30.0, 10.0
CHEEK_EDGE_OUTSIDE, CHEEK_EDGE_INSIDE = 3.0, 0.8
ELBOW_CHEEK_INSIDE, ELBOW_CHEEK_NOSE = 27.0, 47.0
WEB_START, WEB_INSET = 58.0, 1.2
ELBOW_STEP_DIAMETER, ELBOW_STEP_END = 53.0, 52.5
ELBOW_DISC_DIAMETER, ELBOW_DISC_END, ELBOW_CAP, ELBOW_CAP_END = 56.0, 62.0, 24.0, 63.5
WRIST_CHEEK_INSIDE, WRIST_CHEEK_NOSE = 19.5, 42.0
WRIST_STEP_DIAMETER, WRIST_STEP_END = 52.0, 45.0
WRIST_DISC_DIAMETER, WRIST_DISC_END, WRIST_CAP, WRIST_CAP_END = 54.0, 54.5, 23.0, 56.0
WRIST_BOX_X, WRIST_BOX_Y, WRIST_BOX_Z = (31.5, 55.0), (28.5, 71.5), (-19.0, 19.0)
HOUSING_DIAMETER, HOUSING_X = 60.0, (62.5, 122.0)
BUMPER_DIAMETER, BUMPER_X = 76.0, (102.5, 119.0)


def _clamp(x: float) -> Manifold:
    radius, half = CLAMP_DIAMETER / 2, CLAMP_LENGTH / 2
    return lathe([(x - half, radius, 1.2), (x + half, radius, 1.2)], "+x")


def _cover(radius: float, half: float, flutes: int, x: float) -> Manifold:
    ribs = fluted(radius, FLUTE_DEPTH, flutes, (x, 0.0))
    core = rod(2 * (radius - FLUTE_DEPTH - 0.4), -half, half, "+y", (x, 0.0, 0.0), edge=2.0)
    return core + prism(ribs, -half + 1.0, half - 1.0, 0.0, "y")


def _egg(nose: float) -> Outline:
    return hull(circle(CHEEK_RADIUS), circle(CHEEK_NOSE_RADIUS, (nose, 0.0)))


def _cheeks(inside: float, nose: float) -> list[Manifold]:
    egg = _egg(nose)
    inner, outer = CHEEK_EDGE_INSIDE, CHEEK_EDGE_OUTSIDE
    end = inside + CHEEK_THICK
    return [
        prism(egg, inside, end, (inner, outer), "y"),
        prism(egg, -end, -inside, (outer, inner), "y"),
    ]


def _steps(diameter: float, start: float, end: float) -> list[Manifold]:
    profile = [(start - 1.0, diameter / 2, 0.0), (end, diameter / 2, 1.2)]
    return [lathe(profile, "+y"), lathe(profile, "-y")]


def _shaft(diameter: float, y: Range, x: float) -> Manifold:
    return rod(diameter, y[0], y[1], "+y", (x, 0.0, 0.0), edge=0.8)


def upper_arm_link() -> Part:
    """Return the upper arm: from the shoulder's axis to the elbow's, 190 apart."""
    part = Part("upper_arm_link")
    part.add(
        ALUMINIUM,
        rod(TUBE_DIAMETER, 22.0, 171.0, "+x"),
        _clamp(SHOULDER_BELLOWS_RADIUS + 4.0),
        _clamp(UPPER_LENGTH - ELBOW_COVER_RADIUS - 6.0),
        _shaft(SHOULDER_SHAFT, SHOULDER_SHAFT_Y, 0.0),
        _shaft(ELBOW_SHAFT, ELBOW_SHAFT_Y, UPPER_LENGTH),
    )
    part.add(
        RUBBER,
        _cover(SHOULDER_BELLOWS_RADIUS, SHOULDER_BELLOWS_HALF, 32, 0.0),
        _cover(ELBOW_COVER_RADIUS, ELBOW_COVER_HALF, 18, UPPER_LENGTH),
    )
    terminal_box(part, UPPER_BOX_X, UPPER_BOX_Y, UPPER_BOX_Z, (86.0, 106.0), 5)
    middle = sum(UPPER_BOX_X) / 2
    name(part, "KATANA", 6.0, (middle, UPPER_BOX_Y[0], 4.5), "-y")
    name(part, "450", 6.0, (middle, UPPER_BOX_Y[0], -4.5), "-y")
    return part


def forearm_link() -> Part:
    """Return the forearm: a fork at the elbow, a tube to the wrist's axis, 139 away."""
    part = Part("forearm_link")
    end = ELBOW_CHEEK_INSIDE + CHEEK_THICK
    web = prism(inset(_egg(ELBOW_CHEEK_NOSE), WEB_INSET), -end + 1.0, end - 1.0, 0.0, "y")
    web = web ^ block((WEB_START, 90.0), (-50.0, 50.0), (-50.0, 50.0))
    part.add(
        ALUMINIUM,
        *_cheeks(ELBOW_CHEEK_INSIDE, ELBOW_CHEEK_NOSE),
        *_steps(ELBOW_STEP_DIAMETER, end, ELBOW_STEP_END),
        web,
        rod(TUBE_DIAMETER, 62.0, FORE_TUBE_END, "+x"),
        _clamp(80.0),
        _shaft(WRIST_SHAFT, WRIST_SHAFT_Y, FORE_LENGTH),
    )
    bored(part, ELBOW_SHAFT, max(ELBOW_SHAFT_Y) + 0.8)
    part.add(RUBBER, _cover(WRIST_COVER_RADIUS, WRIST_COVER_HALF, 18, FORE_LENGTH))
    hub(part, (ELBOW_STEP_END, ELBOW_DISC_END), ELBOW_DISC_DIAMETER, ELBOW_CAP, ELBOW_CAP_END)
    terminal_box(part, FORE_BOX_X, FORE_BOX_Y, FORE_BOX_Z, (39.0, 59.0), 6)
    screws(part, [(66.0, -end, z) for z in (-12.0, 12.0)], "-y", 5.0)
    return part


def wrist_link() -> Part:
    """Return the wrist: a fork and the round housing whose end face bears the roll joint."""
    part = Part("wrist_link")
    end = WRIST_CHEEK_INSIDE + CHEEK_THICK
    low, high = HOUSING_X
    radius = HOUSING_DIAMETER / 2
    part.add(
        ALUMINIUM,
        *_cheeks(WRIST_CHEEK_INSIDE, WRIST_CHEEK_NOSE),
        *_steps(WRIST_STEP_DIAMETER, end, WRIST_STEP_END),
        lathe(
            [
                (low, radius - 3.0, 1.0),
                (low + 3.0, radius, 1.0),
                (78.0, radius, 0.0),
                (78.0, radius - 0.8, 0.0),
                (79.4, radius - 0.8, 0.0),
                (79.4, radius, 0.0),
                (high - 1.2, radius, 1.0),
                (high - 1.2, radius - 5.0, 0.0),
                (high, radius - 5.0, 0.5),
            ],
            "+x",
        ),
    )
    bored(part, WRIST_SHAFT, max(-WRIST_SHAFT_Y[0], WRIST_SHAFT_Y[1]) + 0.8)
    bumper = BUMPER_DIAMETER / 2
    part.add(
        RUBBER,
        lathe([(BUMPER_X[0], bumper, 2.5), (BUMPER_X[1], bumper, 2.5)], "+x"),
    )
    hub(part, (WRIST_STEP_END, WRIST_DISC_END), WRIST_DISC_DIAMETER, WRIST_CAP, WRIST_CAP_END)
    terminal_box(part, WRIST_BOX_X, WRIST_BOX_Y, WRIST_BOX_Z, (43.0,), 6)
    screws(part, [(60.0, -end, z) for z in (-14.0, 14.0)], "-y", 5.0)
    return part
