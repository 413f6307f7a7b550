"""The family of arms that the closed forms cover, and the canonical arm of each member.

A member pans about axis 1, bends about the parallel axes 2, 3 and 4, which are perpendicular to
axis 1, and rolls about axis 5, which is perpendicular to axes 2 to 4. The axes need not intersect:
the shoulder may be offset from the pan axis, and the roll axis may pass beside axes 1 and 4. Links
have any bearing at q = 0, axes have either sign, and {S} is anywhere.

The canonical arm is stretched along +x at alpha = 0. Its axes are z, y, y, y and the roll axis:

    {C}  on axis 1 at the height of axis 2, z along axis 1 (upwards in {S}), y along axis 2, x to
         the side on which the arm lies at q = 0
    {K}  on the roll axis beside the tool point, x along the roll axis, at alpha = 0 with its y
         along that of {C}
    alpha = sign * q + shift,   T_S_tool(q) = T_C_S^-1 T_C_K(alpha) T_K_tool
    T_C_K = Rz(alpha1) [Ry(phi - tilt) Rx(alpha5), (a + l1 cos.. + l2 cos.. + l3 cos phi, d, ...)]

phi = alpha2 + alpha3 + alpha4 is the angle of link 3 below the horizontal. The Katana is the member
with a = d = tilt = 0, alpha = q, {C} = {S} and {K} the tool itself.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.turns import wrapped

Five = tuple[float, float, float, float, float]
Vector = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FiveAxisArm:
    """The canonical arm of a chain; the module's text defines the frames.

    Attributes:
        a: offset of the shoulder (axis 2) outward from axis 1 [m].
        d: offset along y from axis 1 of the arm's plane, which holds the roll axis [m].
        l1, l2: distances from axis 2 to axis 3 and from axis 3 to axis 4 [m].
        l3: distance from axis 4 to {K} [m].
        tilt: angle of link 3 below the roll axis [rad].
        signs, shifts: alpha = sign * q + shift; shifts in rad.
        T_C_S, T_K_tool: poses (4, 4).
        off_axis: distance of the tool point from the roll axis [m].
        skew, gap: difference [rad], [m] between the chain and the family member that stands for it;
            both are small enough to be rounding in a file.
    """

    a: float
    d: float
    l1: float
    l2: float
    l3: float
    tilt: float
    signs: Five
    shifts: Five
    T_C_S: FloatArray
    T_K_tool: FloatArray
    off_axis: float
    skew: float
    gap: float

    @cached_property
    def reach(self) -> float:
        """An upper bound [m] on the distance of the arm's parts from the origins of {C} and {S}."""
        links = abs(self.a) + abs(self.d) + self.l1 + self.l2 + self.l3 + self.off_axis
        return links + float(np.linalg.norm(self.T_C_S[:3, 3]))

    @cached_property
    def T_tool_K(self) -> FloatArray:
        """The inverse (4, 4) of T_K_tool."""
        return frozen(se3.inverse(self.T_K_tool))

    @cached_property
    def is_canonical(self) -> bool:
        """True if {C} is {S} and {K} is the tool, so that poses need no change of frames."""
        return bool((np.eye(4) == self.T_C_S).all() and (self.T_K_tool == np.eye(4)).all())

    @cached_property
    def is_mirrored(self) -> bool:
        """True if half a turn about axis 1 maps the arm's plane to its own mirror image."""
        return self.a == self.d == self.tilt == 0.0

    def pose(self, T: FloatArray) -> FloatArray:
        """Return T_C_K (4, 4) for the pose `T` (4, 4) = T_S_tool."""
        return T if self.is_canonical else self.T_C_S @ T @ self.T_tool_K

    def canonical(self, q: npt.ArrayLike) -> FloatArray:
        """Return the canonical angles (..., 5) [rad] of the joint angles `q` (..., 5) [rad]."""
        return np.asarray(q) * self.signs + self.shifts

    def joints(self, alpha: npt.ArrayLike) -> FloatArray:
        """Return the joint angles (..., 5) [rad] of the canonical angles `alpha` (..., 5) [rad]."""
        # Adding 0.0 turns negative zeros into zeros.
        return (np.asarray(alpha) - self.shifts) * self.signs + 0.0

    def angles(self, q: FloatArray) -> Five:
        """Return `canonical` of one joint vector (5,) as plain floats."""
        one, two, three, four, five = self.canonical(q).tolist()
        return one, two, three, four, five

    def pitch(self, alpha: Five) -> float:
        """Return the angle [rad] of the roll axis below the horizontal at `alpha` [rad]."""
        return alpha[1] + alpha[2] + alpha[3] - self.tilt

    def beside(self, pitch: float, roll: float) -> Vector:
        """Return the vector [m] from the origin of {K} to the tool point: outward, sideways, up.

        The components are those in the arm's plane. `pitch` is the angle of the roll axis below the
        horizontal, `roll` the turn about it [rad].
        """
        if self.off_axis == 0.0:
            return 0.0, 0.0, 0.0
        x, y, z = self._tool_in_K
        c, s = math.cos(roll), math.sin(roll)
        y, z = c * y - s * z, s * y + c * z
        c, s = math.cos(pitch), math.sin(pitch)
        return c * x + s * z, y, c * z - s * x

    def tool_point(self, alpha: Five) -> Vector:
        """Return the tool point [m] in {C} at the canonical angles `alpha` [rad]."""
        one, two, three, four, five = alpha
        b = two + three
        phi = b + four
        outward, sideways, up = self.beside(phi - self.tilt, five)
        l1, l2, l3 = self.l1, self.l2, self.l3
        u = outward + self.a + l1 * math.cos(two) + l2 * math.cos(b) + l3 * math.cos(phi)
        v = sideways + self.d
        z = up - l1 * math.sin(two) - l2 * math.sin(b) - l3 * math.sin(phi)
        c, s = math.cos(one), math.sin(one)
        return c * u - s * v, s * u + c * v, z

    @cached_property
    def _tool_in_K(self) -> Vector:
        x, y, z = self.T_K_tool[:3, 3].tolist()
        return x, y, z


@lru_cache(maxsize=64)
def family_arm(chain: Chain) -> FiveAxisArm | None:
    """Return `arm_of`; None for a chain outside the family."""
    try:
        return arm_of(chain)
    except RobotDescriptionError:
        return None


@lru_cache(maxsize=64)
def arm_of(chain: Chain) -> FiveAxisArm:
    """Return the canonical arm of `chain`; the result is cached.

    Raises RobotDescriptionError when the chain is not in the family. The message names every axis
    at fault, its deviation and the condition.
    """
    if chain.n != 5 or any(chain.slides):
        raise RobotDescriptionError(
            "The closed-form kinematics need five joints that turn; this arm has "
            f"{chain.n - sum(chain.slides)}."
        )
    omega = [chain.S[:3, i] for i in range(5)]
    skew = _refuse_skewed(omega)
    T_C_S = _canonical_frame(chain)
    shoulder, elbow, wrist, roll = (
        T_C_S[:3, :3] @ screws.point_on(chain.S[:, i]) + T_C_S[:3, 3] for i in (1, 2, 3, 4)
    )
    home = T_C_S @ chain.M
    tool = home[:3, 3]
    # Moves an axis that is not perpendicular by a rounding error to its place beside the tool.
    turned = T_C_S[:3, :3] @ omega[4]
    roll = roll + float((tool - roll) @ turned) * turned

    along = T_C_S[:3, :3] @ omega[4]
    along = np.array([along[0], 0.0, along[2]]) / math.hypot(along[0], along[2])
    tool_length = float(along @ (tool - wrist))
    sign5 = -1.0 if tool_length < -tolerances.FAMILY_LENGTH else 1.0
    x_K = sign5 * along
    foot = roll + (along @ (tool - roll)) * along
    off_axis = float(np.linalg.norm(tool - foot))
    gap = off_axis if off_axis <= tolerances.FAMILY_LENGTH else 0.0

    l1, bearing1 = _link(elbow - shoulder)
    l2, bearing2 = _link(wrist - elbow)
    l3, bearing3 = _link(foot - wrist)
    names = ("axes 2 and 3", "axes 3 and 4", "axis 4 and the tool point")
    for name, length in zip(names, (l1, l2, l3), strict=True):
        if length <= tolerances.FAMILY_LENGTH:
            raise RobotDescriptionError(
                "The closed-form kinematics do not cover this arm: "
                f"{name} are {1e3 * length:.3g} mm apart; they must not coincide."
            )
    pitch = math.atan2(-x_K[2], x_K[0])
    R_C_K = so3.rotation_y(pitch)
    T_K_tool = se3.from_rotation_translation(
        R_C_K.T @ home[:3, :3], np.zeros(3) if gap else R_C_K.T @ (tool - foot)
    )
    y_C = T_C_S[1, :3]
    signs = (
        math.copysign(1.0, T_C_S[2, :3] @ omega[0]),
        *(math.copysign(1.0, y_C @ omega[i]) for i in (1, 2, 3)),
        sign5,
    )
    shifts = (0.0, bearing1, wrapped(bearing2 - bearing1), wrapped(bearing3 - bearing2), 0.0)
    return FiveAxisArm(
        a=_tidy(shoulder[0]),
        d=_tidy(roll[1]),
        l1=l1,
        l2=l2,
        l3=l3,
        tilt=_tidy(wrapped(bearing3 - pitch)),
        signs=(signs[0], signs[1], signs[2], signs[3], signs[4]),
        shifts=(0.0, _tidy(shifts[1]), _tidy(shifts[2]), _tidy(shifts[3]), 0.0),
        T_C_S=frozen(_tidied(T_C_S)),
        T_K_tool=frozen(_tidied(T_K_tool)),
        off_axis=0.0 if gap else off_axis,
        skew=skew,
        gap=gap,
    )


def _refuse_skewed(omega: list[FloatArray]) -> float:
    """Return the largest deviation [rad] of an axis; raise when it is more than rounding."""
    faults, skew, coarse = [], 0.0, True
    for name, needed, off in _skews(omega):
        skew = max(skew, off)
        if off > tolerances.FAMILY_ANGLE:
            faults.append(f"{name} must be {needed} and is {math.degrees(off):.3g} deg off")
            coarse = coarse and off <= tolerances.COARSE_ANGLE
    if faults:
        raise RobotDescriptionError(
            f"The closed-form kinematics do not cover this arm: {'; '.join(faults)}."
            + (" For right angles write 1.570796 instead of 1.57." if coarse else "")
        )
    return skew


def _skews(omega: list[FloatArray]) -> Iterator[tuple[str, str, float]]:
    """Yield (axis, condition, deviation [rad]) for every condition on the directions."""
    one, two, three, four, five = omega
    yield "axis 2", "perpendicular to axis 1", _from_square(one, two)
    yield "axis 3", "parallel to axis 2", _from_parallel(two, three)
    yield "axis 4", "parallel to axis 2", _from_parallel(two, four)
    yield "axis 5", "perpendicular to axis 4", _from_square(four, five)


def _from_square(a: FloatArray, b: FloatArray) -> float:
    """Return the deviation [rad] of two unit vectors from a right angle."""
    return abs(math.atan2(float(a @ b), float(np.linalg.norm(np.cross(a, b)))))


def _from_parallel(a: FloatArray, b: FloatArray) -> float:
    """Return the deviation [rad] of two unit vectors from being parallel."""
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b)))


def _canonical_frame(chain: Chain) -> FloatArray:
    """Return T_C_S (4, 4)."""
    one, two = chain.S[:3, 0], chain.S[:3, 1]
    z = -one if one[2] < -tolerances.FAMILY_ANGLE else one
    # Axes 2, 3 and 4 differ by rounding: take their mean direction, perpendicular to axis 1.
    y = two + sum(math.copysign(1.0, two @ other) * other for other in chain.S[:3, 2:4].T)
    y = y - (y @ z) * z
    y = y / np.linalg.norm(y)
    pan, *others = (screws.point_on(chain.S[:, i]) for i in range(4))
    points = np.array(others) - pan
    outward = points @ np.cross(y, z)
    farthest = outward[np.abs(outward).argmax()]
    if farthest < -tolerances.FAMILY_LENGTH:
        y = -y
    R_C_S = np.stack((np.cross(y, z), y, z))
    origin = pan + (z @ points[0]) * z
    return se3.from_rotation_translation(R_C_S, -R_C_S @ origin)


def _link(v: FloatArray) -> tuple[float, float]:
    """Return a link's length [m] and its angle [rad] below the horizontal, in the arm's plane."""
    return math.hypot(v[0], v[2]), math.atan2(-v[2], v[0])


def _tidy(value: float) -> float:
    """Return `value`, or 0 where it is only rounding."""
    return 0.0 if abs(value) <= tolerances.ROUNDING else float(value)


def _tidied(T: FloatArray) -> FloatArray:
    """Return `T` without rounding next to 0 and 1, so that exact frames need no transformation."""
    whole = np.round(T)
    return np.where(np.abs(T - whole) <= tolerances.ROUNDING, whole, T) + 0.0


STEPS = 5
"""Angles of each axis at which the change by the exact arm is measured."""


def exact_member(chain: Chain, up: FloatArray) -> tuple[Chain, list[str]]:
    """Return the exact arm for ``chain``, and notes on what the change moves.

    Axes within FAMILY_ANGLE of perpendicular, parallel or upright become so, and a tool point
    within FAMILY_LENGTH of axis 5 is put on it. A chain that is exact within FAMILY_EXACT is
    returned unchanged, without a note.

    Args:
        chain: the arm from the file.
        up: unit vector (3,) that points upwards, in {S}.

    Raises:
        RobotDescriptionError: the chain is outside the family; the message names the axes at fault.
    """
    arm = arm_of(chain)
    z = arm.T_C_S[2, :3]
    lean = math.atan2(float(np.linalg.norm(np.cross(z, up))), abs(float(z @ up)))
    upright = lean <= tolerances.FAMILY_ANGLE
    off = max(arm.skew, lean if upright else 0.0)
    if max(off, arm.gap) <= tolerances.FAMILY_EXACT:
        return chain, []
    T_S_C = se3.inverse(arm.T_C_S)
    if upright:
        T_S_C[:3, :3] = _turn(z, math.copysign(1.0, float(z @ up)) * up) @ T_S_C[:3, :3]
    exact = _exact(chain, arm, T_S_C)
    moved, turned = _change(chain, exact)
    offset = (
        f", the tool point is {1e3 * arm.gap:.2g} mm beside the roll axis"
        if arm.gap > tolerances.FAMILY_EXACT
        else ""
    )
    note = (
        "Axes deviate from perpendicular, parallel or upright by up to "
        f"{math.degrees(off):.2g} deg{offset}. This is treated as rounding: the exact arm is used, "
        f"whose tool differs by at most about {1e3 * moved:.1g} mm and "
        f"{math.degrees(turned):.1g} deg."
    )
    return exact, [note]


def _exact(chain: Chain, arm: FiveAxisArm, T_S_C: FloatArray) -> Chain:
    """Return the canonical arm as a chain in {S}; ``T_S_C`` (4, 4) is the pose of {C}."""
    bearings = np.cumsum(arm.shifts[1:4])
    links = np.array((arm.l1, arm.l2, arm.l3))
    steps = np.column_stack((np.cos(bearings), np.zeros(3), -np.sin(bearings))) * links[:, None]
    shoulder = np.array((arm.a, 0.0, 0.0))
    elbow, wrist, foot = shoulder + np.cumsum(steps, axis=0)
    foot += np.array((0.0, arm.d, 0.0))
    R_C_K = so3.rotation_y(float(bearings[2]) - arm.tilt)
    y = np.array((0.0, 1.0, 0.0))
    roll = arm.signs[4] * R_C_K[:, 0]
    directions = (np.array((0.0, 0.0, arm.signs[0])), *(s * y for s in arm.signs[1:4]), roll)
    points = (np.zeros(3), shoulder, elbow, wrist, foot)
    S_C = [screws.revolute(w, p) for w, p in zip(directions, points, strict=True)]
    home = arm.T_C_S @ chain.M
    # The tool keeps its bearing to the roll axis.
    R_C_tool = _turn(arm.T_C_S[:3, :3] @ chain.S[:3, 4], roll) @ home[:3, :3]
    tool_point = foot + R_C_K @ arm.T_K_tool[:3, 3]
    M = T_S_C @ se3.from_rotation_translation(R_C_tool, tool_point)
    S = screws.moved(T_S_C, np.column_stack(S_C))
    return dataclasses.replace(chain, M=M, S=S)


def _turn(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) that brings direction ``a`` (3,) to ``b`` (3,)."""
    across = np.cross(a, b)
    sine = float(np.linalg.norm(across))
    if sine == 0.0:
        return np.eye(3)
    return so3.exp(across / sine * math.atan2(sine, float(a @ b)))


def _change(chain: Chain, exact: Chain) -> tuple[float, float]:
    """Return the maximum differences [m], [rad] of the tools over a grid within the limits."""
    ranges = np.linspace(chain.lower, chain.upper, STEPS).T
    q = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, chain.n)
    one, other = forward_batch(chain, q), forward_batch(exact, q)
    moved = np.linalg.norm(one[:, :3, 3] - other[:, :3, 3], axis=1)
    # For so small a turn, the norm of the difference is root 2 times the angle.
    turned = np.linalg.norm(one[:, :3, :3] - other[:, :3, :3], axis=(1, 2)) / math.sqrt(2.0)
    return float(moved.max()), float(turned.max())
