"""A target for the canonical arm: a point, and an orientation relative to the arm's plane."""

from __future__ import annotations

import math
from typing import NamedTuple

from katana450 import tolerances
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import FiveAxisArm, Vector
from katana450.maths.kinematics.branch import Shoulder
from katana450.maths.kinematics.priority import Priority


class PlaneOrientation(NamedTuple):
    """A target orientation relative to the arm's plane, as a unit quaternion.

    With theta1 set, the arm's orientations are Rz(theta1) Ry(phi) Rx(psi): pitch phi, roll psi. In
    the plane the target is A = Rz(theta1)^T R, as a quaternion (w, x, y, z), and its overlap

        F(phi, psi) = [cos phi/2, sin phi/2] [[w, x], [y, -z]] [cos psi/2, sin psi/2]^T

    with Ry(phi) Rx(psi) is the cosine of half the angle between them. |F| has one maximum in (phi,
    psi), and one in each alone. Angles in rad.
    """

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


class CanonicalTarget(NamedTuple):
    """A target in {C}; lengths in m, angles in rad.

    Attributes:
        x, y, z: target of the point of {K}, or of a point that is offset by `beside`.
        beside: offset of that point in the arm's plane: outward, sideways, up.
        tool: target of the tool point.
        along: the target's roll axis, or None if the arm's plane is free.
        orientation: target of {K} with the plane at theta1 = 0, or in any plane if that is free.
        priority: the part of the target that is kept.
        inward: True if the roll axis points towards axis 1; None if the plane at theta1 decides
            this. Used only if the yaw does not count.
    """

    x: float
    y: float
    z: float
    beside: Vector
    tool: Vector
    along: Vector | None
    orientation: PlaneOrientation
    priority: Priority
    inward: bool | None = None

    @staticmethod
    def pose(T_C_K: FloatArray, tool: Vector, priority: Priority) -> CanonicalTarget:
        """Return the target with the pose `T_C_K` (4, 4) and the place of its `tool` point."""
        (a, _, _, x), (d, _, _, y), (g, _, _, z), _ = T_C_K.tolist()
        orientation = PlaneOrientation.of(T_C_K[:3, :3])
        return CanonicalTarget(x, y, z, (0.0, 0.0, 0.0), tool, (a, d, g), orientation, priority)

    @staticmethod
    def five(
        arm: FiveAxisArm, tool: Vector, pitch: float, roll: float, priority: Priority
    ) -> CanonicalTarget:
        """Return the target of five freedoms: `tool` point, pitch and roll in the arm's plane."""
        orientation = PlaneOrientation.turned(pitch, roll)
        offset = arm.beside(pitch, roll)
        return CanonicalTarget(*tool, offset, tool, None, orientation, priority)

    def seen_from(self, theta1: float) -> PlaneOrientation:
        """Return the target orientation in the plane at `theta1`."""
        if self.along is None:
            return self.orientation
        orientation = self.orientation.seen_from(theta1)
        if self.priority is Priority.POSE:
            return orientation
        pitch = self.pitch(theta1)
        if orientation.overlap(pitch) <= tolerances.TOUCHING:
            # Half a turn away every roll is equally near: keep the roll of the target.
            orientation = self.orientation.seen_from(theta1 + math.pi)
        return PlaneOrientation.turned(pitch, orientation.best_roll(pitch))

    def heading(self, theta1: float) -> Vector:
        """Return the target's roll axis in the plane at `theta1`: outward, sideways, down."""
        if self.along is None:
            pitch = self.pitch(theta1)
            return math.cos(pitch), 0.0, math.sin(pitch)
        dx, dy, dz = self.along
        c, s = math.cos(theta1), math.sin(theta1)
        return c * dx + s * dy, c * dy - s * dx, -dz

    def pitch(self, theta1: float) -> float:
        """Return the pitch of the target's roll axis, past the vertical when it points inwards.

        This is the pitch as seen in the plane at `theta1`, or the true pitch if only that counts.
        """
        if self.along is None:
            return self.orientation.best()[0]
        outward, sideways, down = self.heading(theta1)
        if self.priority is not Priority.POSE:
            flat = math.hypot(outward, sideways)
            inward = outward < 0.0 if self.inward is None else self.inward
            outward = -flat if inward else flat
        return math.atan2(down, outward)

    def roll(self) -> float:
        """Return the roll of a `faced` target in the plane that its roll axis lies in."""
        outward, sideways, _ = self.heading(0.0)
        theta1 = math.atan2(sideways, outward) + (math.pi if self.inward else 0.0)
        return self.orientation.seen_from(theta1).best_roll(self.pitch(theta1))

    @property
    def on_axis(self) -> bool:
        """True if the point is on axis 1, which leaves theta1 free."""
        return math.hypot(self.x, self.y) <= tolerances.ON_AXIS

    def aside(self, arm: FiveAxisArm) -> float:
        """Return the sideways place of the point in the arm's plane, from axis 1 [m]."""
        return arm.d + self.beside[1]

    def facing(self, arm: FiveAxisArm, shoulder: Shoulder) -> float | None:
        """Return the theta1 of a plane with the point on the side of `shoulder`; None on axis 1."""
        if self.on_axis:
            return None
        d, rho = self.aside(arm), math.hypot(self.x, self.y)
        u = math.sqrt(max(rho - abs(d), 0.0) * (rho + abs(d)))
        return self.aligned(arm, u if shoulder == "front" else -u)

    def aligned(self, arm: FiveAxisArm, u: float) -> float:
        """Return the theta1 that turns a place `u` [m] outward in the plane towards the point."""
        return math.atan2(self.y, self.x) - math.atan2(self.aside(arm), u)

    def pitched(self, arm: FiveAxisArm, pitch: float) -> CanonicalTarget:
        """Return the same five freedoms with another `pitch`."""
        return CanonicalTarget.five(
            arm, self.tool, pitch, self.orientation.best()[1], self.priority
        )

    def faced(self, *, inward: bool) -> CanonicalTarget:
        """Return the same target with the roll axis towards axis 1, or away from it."""
        return self._replace(inward=inward)

    def moved(self, dx: float, dy: float, dz: float) -> CanonicalTarget:
        """Return the target with its point moved by (dx, dy, dz) [m] and the same tool point."""
        return self._replace(x=self.x + dx, y=self.y + dy, z=self.z + dz)
