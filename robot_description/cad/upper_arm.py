"""upper_arm_link: from the shoulder's axis to the elbow's, with the terminal box; mm.

The origin lies on the shoulder's axis, x along the link, y along the axis.
"""

from __future__ import annotations

from robot_description.cad import conduit
from robot_description.cad.fittings import name, screws, terminal_box
from robot_description.cad.fork import BELLOWS_RADIUS, TUBE_DIAMETER, bellows, clamp, cover, shaft
from robot_description.cad.material import ALUMINIUM, RUBBER
from robot_description.cad.part import Part
from robot_description.cad.solid import rod

LENGTH = 190.0
SHOULDER_SHAFT, SHOULDER_SHAFT_Y = 42.0, (-37.0, 46.0)
ELBOW_SHAFT, ELBOW_SHAFT_Y = 38.0, (-47.5, 47.0)
ELBOW_COVER_RADIUS, ELBOW_COVER_HALF = 36.6, 26.0
BOX_X, BOX_Y, BOX_Z = (75.0, 117.0), (-18.5, 50.5), (-19.0, 19.0)
NAME_HEIGHT = 5.2


def upper_arm_link() -> Part:
    """Return the upper arm in its frame."""
    part = Part("upper_arm_link")
    part.add(
        ALUMINIUM,
        rod(TUBE_DIAMETER, 22.0, 171.0, "+x"),
        clamp(BELLOWS_RADIUS + 4.5),
        clamp(LENGTH - ELBOW_COVER_RADIUS - 5.0),
        shaft(SHOULDER_SHAFT, SHOULDER_SHAFT_Y, 0.0),
        shaft(ELBOW_SHAFT, ELBOW_SHAFT_Y, LENGTH),
    )
    part.add(RUBBER, bellows(), cover(ELBOW_COVER_RADIUS, ELBOW_COVER_HALF, LENGTH))
    terminal_box(part, BOX_X, BOX_Y, BOX_Z, (conduit.UPPER_IN, conduit.UPPER_OUT))
    middle = sum(BOX_X) / 2
    name(part, "katana450", NAME_HEIGHT, (middle, BOX_Y[0], 0.0), "-y")
    corners = [(middle + u, BOX_Y[0], w) for u in (-17.0, 17.0) for w in (-15.0, 15.0)]
    screws(part, corners, "-y", 3.4)
    return part
