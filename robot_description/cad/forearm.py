"""forearm_link: a fork at the elbow, a terminal box on it, a tube to the wrist's axis; mm.

The origin lies on the elbow's axis, x along the link, y along the axis.
"""

from __future__ import annotations

from robot_description.cad import conduit
from robot_description.cad.fittings import bored, hub, screws, terminal_box
from robot_description.cad.fork import (
    CHEEK_THICK,
    TUBE_DIAMETER,
    cheeks,
    clamp,
    cover,
    egg,
    shaft,
    steps,
)
from robot_description.cad.material import ALUMINIUM, RUBBER
from robot_description.cad.outline import inset
from robot_description.cad.part import Part
from robot_description.cad.solid import block, prism, rod
from robot_description.cad.upper_arm import ELBOW_SHAFT, ELBOW_SHAFT_Y

LENGTH = 139.0
CHEEK_INSIDE, CHEEK_NOSE = 27.0, 47.0
WEB_START, WEB_INSET = 58.0, 1.2
STEP_DIAMETER, STEP_END = 53.0, 51.5
DISC_DIAMETER, DISC_END, CAP_DIAMETER, CAP_END = 56.0, 62.3, 24.0, 63.3
BOX_X, BOX_Y, BOX_Z = (30.5, 68.0), (36.0, 77.0), (-21.0, 21.0)
TUBE_END = 120.0
WRIST_SHAFT, WRIST_SHAFT_Y = 38.0, (-41.5, 37.5)
WRIST_COVER_RADIUS, WRIST_COVER_HALF = 35.5, 18.5


def forearm_link() -> Part:
    """Return the forearm in its frame."""
    part = Part("forearm_link")
    end = CHEEK_INSIDE + CHEEK_THICK
    web = prism(inset(egg(CHEEK_NOSE), WEB_INSET), -end + 1.0, end - 1.0, 0.0, "y")
    web = web ^ block((WEB_START, 90.0), (-50.0, 50.0), (-50.0, 50.0))
    part.add(
        ALUMINIUM,
        *cheeks(CHEEK_INSIDE, CHEEK_NOSE),
        *steps(STEP_DIAMETER, end, STEP_END),
        web,
        rod(TUBE_DIAMETER, 62.0, TUBE_END, "+x"),
        clamp(91.0),
        shaft(WRIST_SHAFT, WRIST_SHAFT_Y, LENGTH),
    )
    bored(part, ELBOW_SHAFT, max(map(abs, ELBOW_SHAFT_Y)) + 0.8)
    part.add(RUBBER, cover(WRIST_COVER_RADIUS, WRIST_COVER_HALF, LENGTH))
    hub(part, (STEP_END, DISC_END), DISC_DIAMETER, CAP_DIAMETER, CAP_END)
    terminal_box(part, BOX_X, BOX_Y, BOX_Z, (conduit.ELBOW_IN, conduit.ELBOW_OUT))
    screws(part, [(66.0, -end, z) for z in (-12.0, 12.0)], "-y", 5.0)
    screws(part, [(40.0, -end, z) for z in (-25.0, 25.0)], "-y", 5.0)
    return part
