"""The orientation in the arm's vertical plane that is nearest to a target orientation.

With theta1 set, the arm's orientations are Rz(theta1) Ry(phi) Rx(psi): pitch phi, roll psi. In the
plane the target is A = Rz(theta1)^T R, as a quaternion (w, x, y, z), and its overlap

    F(phi, psi) = [cos phi/2, sin phi/2] [[w, x], [y, -z]] [cos psi/2, sin psi/2]^T

with Ry(phi) Rx(psi) is the cosine of half the angle between them. |F| has one maximum in (phi,
psi), and one in each alone. Angles in rad.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray


class PlaneOrientation(NamedTuple):
    """A target orientation relative to the arm's plane, as a unit quaternion."""

    w: float
    x: float
    y: float
    z: float

    @staticmethod
    def of(R: FloatArray) -> PlaneOrientation:
        """Return the orientation of the rotation `R` (3, 3), with the arm's plane at theta1 = 0."""
        w, x, y, z = so3.to_quaternion(R).tolist()
        return PlaneOrientation(w, x, y, z)

    @staticmethod
    def turned(phi: float, psi: float) -> PlaneOrientation:
        """Return Ry(phi) Rx(psi), which the arm can take."""
        cf, sf = math.cos(0.5 * phi), math.sin(0.5 * phi)
        cp, sp = math.cos(0.5 * psi), math.sin(0.5 * psi)
        return PlaneOrientation(cf * cp, cf * sp, sf * cp, -sf * sp)

    def seen_from(self, theta1: float) -> PlaneOrientation:
        """Return the same orientation with the arm's plane at `theta1`: Rz(theta1)^T A."""
        w, x, y, z = self
        c, s = math.cos(0.5 * theta1), math.sin(0.5 * theta1)
        return PlaneOrientation(c * w + s * z, c * x + s * y, c * y - s * x, c * z - s * w)

    def tilted(self, tilt: float) -> PlaneOrientation:
        """Return Ry(tilt) A; phi + tilt relative to it is what phi is relative to A."""
        w, x, y, z = self
        c, s = math.cos(0.5 * tilt), math.sin(0.5 * tilt)
        return PlaneOrientation(c * w - s * y, c * x + s * z, c * y + s * w, c * z - s * x)

    def best(self) -> tuple[float, float]:
        """Return the nearest (phi, psi): the top singular vectors of the matrix, in closed form."""
        total = math.atan2(self.x + self.y, self.w + self.z)
        difference = math.atan2(self.y - self.x, self.w - self.z)
        return total + difference, total - difference

    def best_roll(self, phi: float) -> float:
        """Return the nearest psi for a given phi."""
        c, s = math.cos(0.5 * phi), math.sin(0.5 * phi)
        return 2.0 * math.atan2(c * self.x - s * self.z, c * self.w + s * self.y)

    def overlap(self, phi: float) -> float:
        """Return the cosine of half the angle that the nearest roll leaves for a given phi."""
        c, s = math.cos(0.5 * phi), math.sin(0.5 * phi)
        return math.hypot(c * self.x - s * self.z, c * self.w + s * self.y)

    def best_pitch(self, psi: float) -> float:
        """Return the nearest phi for a given psi."""
        c, s = math.cos(0.5 * psi), math.sin(0.5 * psi)
        return 2.0 * math.atan2(c * self.y - s * self.z, c * self.w + s * self.x)

    def best_turn(self, psi: float) -> float:
        """Return the theta1 that comes nearest, with some pitch, for a given psi.

        The pairs (theta1, phi) are treated as (phi, psi) in `best`: A Rx(psi)^T is the target of
        Rz(theta1) Ry(phi), and the matrix of its overlap with that is [[w, y], [z, -x]].
        """
        c, s = math.cos(0.5 * psi), math.sin(0.5 * psi)
        w, x = c * self.w + s * self.x, c * self.x - s * self.w
        y, z = c * self.y - s * self.z, c * self.z + s * self.y
        theta1, _ = PlaneOrientation(w, y, z, x).best()
        return theta1

    def angle(self, phi: float, psi: float) -> float:
        """Return the angle [rad] between the target orientation and Ry(phi) Rx(psi)."""
        a, b, c, d = PlaneOrientation.turned(phi, psi)
        w, x, y, z = self
        cosine = a * w + b * x + c * y + d * z
        sine = math.hypot(
            a * x - b * w - c * z + d * y,
            a * y + b * z - c * w - d * x,
            a * z - b * y + c * x - d * w,
        )
        return 2.0 * math.atan2(sine, abs(cosine))
