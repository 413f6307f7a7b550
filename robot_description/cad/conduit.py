"""The conduit: where each stretch of it is held, and the file that tells so without solids.

The stretches hang free between fittings, so no mesh holds them: whoever shows the arm draws each as
a curve between its two ends. Dimensions are mm here, metres in the file.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

RADIUS = 8.0
"""Of the conduit, mm."""

NUT_HEIGHT = 4.5
BALL_HEIGHT = 6.0  # of the swivel's centre over the surface
SLEEVE_LENGTH = 14.0  # from the swivel's centre to the mouth
EYE_HALF = 5.0  # half the length of a ring that the conduit passes through
INSERTED = 2.0  # how deep the conduit sits in a mouth

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Gland:
    """A swivel gland on a face towards +y: ``at`` on the face, ``lean`` degrees off its normal.

    It leans in the plane of the normal and the axis ``along`` ("x" or "z"), towards its positive
    end where ``lean`` is positive.
    """

    link: str
    at: Vector
    lean: float
    along: str = "x"

    @property
    def outward(self) -> Vector:
        """The unit vector out of its mouth."""
        side, up = math.sin(math.radians(self.lean)), math.cos(math.radians(self.lean))
        return (side, up, 0.0) if self.along == "x" else (0.0, up, side)

    @property
    def swivel(self) -> Vector:
        """The centre of its ball."""
        return (self.at[0], self.at[1] + BALL_HEIGHT, self.at[2])

    @property
    def mouth(self) -> Vector:
        """Where the conduit ends, a little inside the sleeve."""
        reach = SLEEVE_LENGTH - INSERTED
        x, y, z = (c + reach * d for c, d in zip(self.swivel, self.outward, strict=True))
        return (x, y, z)


@dataclass(frozen=True)
class Eye:
    """A ring about the vertical axis through ``at``, its middle; it leads the conduit upwards."""

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
    """A free run of conduit of rest length ``length``; one that ``winds`` lies about an axis."""

    name: str
    start: Gland | Eye
    end: Gland | Eye
    length: float
    winds: str | None = None  # the joint about whose axis it lies when that turns


STRETCHES = (
    Stretch("base to shoulder", BASE, SHOULDER, 230.0, winds="axis_1"),
    Stretch("shoulder to upper arm", SHOULDER, UPPER_IN, 152.0),
    Stretch("upper arm to elbow", UPPER_OUT, ELBOW_IN, 150.0),
    Stretch("elbow to wrist", ELBOW_OUT, WRIST, 150.0),
)


def _end(fitting: Gland | Eye, along: float) -> dict[str, object]:
    """Describe one end; ``along`` is 1 where the conduit leaves the fitting, -1 where it comes."""
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
    end's link. ``length`` [m] is the rest length. A stretch with ``winds`` goes round the axis of
    the joint named: it is a smooth curve in cylindrical coordinates about it, in which its angle
    follows the joint's.
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
