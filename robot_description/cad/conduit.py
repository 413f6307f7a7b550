"""The conduit: the fittings of each stretch, and the file that describes them without solids.

The stretches hang free between fittings, so no mesh contains them. Programs that show the arm draw
each as a curve between its two ends. Dimensions are in mm here and in metres in the file.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

RADIUS = 8.0
"""Radius of the conduit, mm."""

NUT_HEIGHT = 4.5
BALL_HEIGHT = 6.0  # of the swivel's centre over the surface
SLEEVE_LENGTH = 14.0  # from the swivel's centre to the mouth
EYE_HALF = 5.0  # half the length of a ring that the conduit passes through
INSERTED = 2.0  # how deep the conduit sits in a mouth

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Gland:
    """A swivel gland on a face towards +y.

    ``at`` is on the face. The gland leans ``lean`` degrees from the normal, in the plane of the
    normal and the axis ``along`` ("x" or "z"); a positive ``lean`` is towards the positive axis.
    """

    link: str
    at: Vector
    lean: float
    along: str = "x"

    @property
    def outward(self) -> Vector:
        """Unit vector out of the gland's mouth."""
        side, up = math.sin(math.radians(self.lean)), math.cos(math.radians(self.lean))
        return (side, up, 0.0) if self.along == "x" else (0.0, up, side)

    @property
    def swivel(self) -> Vector:
        """Centre of the gland's ball."""
        return (self.at[0], self.at[1] + BALL_HEIGHT, self.at[2])

    @property
    def mouth(self) -> Vector:
        """End of the conduit, a little inside the sleeve."""
        reach = SLEEVE_LENGTH - INSERTED
        x, y, z = (c + reach * d for c, d in zip(self.swivel, self.outward, strict=True))
        return (x, y, z)


@dataclass(frozen=True)
class Eye:
    """A ring around the vertical axis through its middle ``at``; it leads the conduit upwards."""

    link: str
    at: Vector


BASE = Gland("arm_base_link", (7.0, 58.2, 30.5), 42.0, "z")
SHOULDER = Eye("pan_link", (4.0, 76.0, -47.0))
UPPER_IN = Gland("upper_arm_link", (86.0, 50.5, 0.0), -28.0)
UPPER_OUT = Gland("upper_arm_link", (106.0, 50.5, 0.0), 12.0)
ELBOW_IN = Gland("forearm_link", (39.0, 77.0, 0.0), -12.0)
ELBOW_OUT = Gland("forearm_link", (59.5, 77.0, 0.0), 14.0)
WRIST = Gland("wrist_link", (43.0, 71.5, 0.0), -14.0)


@dataclass(frozen=True)
class Stretch:
    """A free run of conduit with rest length ``length``; it may lie around the axis of a joint."""

    name: str
    start: Gland | Eye
    end: Gland | Eye
    length: float
    winds: str | None = None  # the joint around whose axis it lies


STRETCHES = (
    Stretch("base to shoulder", BASE, SHOULDER, 230.0, winds="axis_1"),
    Stretch("shoulder to upper arm", SHOULDER, UPPER_IN, 152.0),
    Stretch("upper arm to elbow", UPPER_OUT, ELBOW_IN, 150.0),
    Stretch("elbow to wrist", ELBOW_OUT, WRIST, 150.0),
)


def _end(fitting: Gland | Eye, along: float) -> dict[str, object]:
    """Return the description of one end; ``along``: 1 at the start of a stretch, -1 at its end."""
    if isinstance(fitting, Eye):
        x, y, z = fitting.at
        point, tangent = (x, y, z + along * (EYE_HALF - INSERTED)), (0.0, 0.0, 1.0)
    else:
        point = fitting.mouth
        a, b, c = fitting.outward
        tangent = (along * a, along * b, along * c)
    return {
        "link": fitting.link,
        "point": [round(value / 1e3, 6) for value in point],
        "tangent": [round(value, 6) + 0.0 for value in tangent],
    }


def conduits_json() -> str:
    """Return the text of ``conduits.json``.

    ``point`` [m] and unit ``tangent``, from the first end to the second, are in the frame of the
    end's link. ``length`` [m] is the rest length. A stretch with ``winds`` lies around the axis of
    that joint: it is a smooth curve in cylindrical coordinates about it, whose angle follows the
    joint's.
    """
    stretches = [
        {
            "name": stretch.name,
            "ends": [_end(stretch.start, 1.0), _end(stretch.end, -1.0)],
            "radius": RADIUS / 1e3,
            "length": stretch.length / 1e3,
            "winds": stretch.winds,
        }
        for stretch in STRETCHES
    ]
    return json.dumps({"conduits": stretches}, indent=2) + "\n"
