"""What the arm can do at once: how fast, in which directions, how near to where it loses one.

A twist has two units, so singular values mean something only with a length in them: translations
are divided by the arm's characteristic length. Twists are (omega, v), v that of the tool point.
Sources: Yoshikawa (1985) for the manipulability; Nakamura & Hanafusa (1986) for the damping;
Lynch & Park, Modern Robotics (2017), ch. 5.3 and 5.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import screws
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body, joint_frames

WELL_CONDITIONED: Final = 0.05
"""[1] Smallest singular value from which on joint rates are not damped."""

STRONGEST_DAMPING: Final = 0.05
"""[1] Damping where a singular value is 0, falling to none at WELL_CONDITIONED: joint rates of a
unit wish stay below 1.21 / WELL_CONDITIONED, not far above what they are where damping begins."""


SLOW: Final = 1e-3
"""[rad/s], over the length: a wish that no joint is too slow for. [s] A time that is short."""


class JogFrame(Enum):
    """Whose axes a jog is along; its linear velocity is that of the tool point either way."""

    BASE = "base"
    TOOL = "tool"


@dataclass(frozen=True, eq=False)
class VelocityEllipsoid:
    """Velocities of the tool point with joint rates of unit norm.

    axes: (3, 3), the principal directions in {S} as columns, right-handed. radii: (3,) [m/rad],
    falling. Where a radius is 0 the arm cannot move the tool point that way.
    """

    axes: FloatArray
    radii: FloatArray


@lru_cache(maxsize=16)
def characteristic_length(chain: Chain) -> float:
    """[m] Root mean square over the joints of the tool point's distance from their axes, at q = 0.

    A joint rate moves the tool by about as much along as it turns it, counted in this length.
    """
    p = chain.M[:3, 3]
    arms = [np.linalg.norm(np.cross(axis[:3], p - screws.point_on(axis))) for axis in chain.S.T]
    return float(np.sqrt(np.mean(np.square(arms))))


def singular_values(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """(n,) singular values [1] of the Jacobian at `q` (n,) [rad], falling; 0 in a singularity."""
    J = jacobian_body(chain, q)
    J[3:] /= characteristic_length(chain)
    return np.asarray(np.linalg.svd(J, compute_uv=False))


def manipulability(chain: Chain, q: npt.ArrayLike) -> float:
    """Yoshikawa's measure [1]: sqrt(det(J^T J)), the product of the singular values."""
    return float(np.prod(singular_values(chain, q)))


def condition_number(chain: Chain, q: npt.ArrayLike) -> float:
    """Largest over smallest singular value, at least 1; infinite in a singularity."""
    values = singular_values(chain, q)
    return float(values[0] / values[-1]) if values[-1] > 0.0 else math.inf


def limit_distances(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """(n,) [rad] from each joint of `q` (n,) to its nearer limit; negative beyond it."""
    q = chain.check_q(q)
    return np.minimum(q - chain.lower, chain.upper - q)


def velocity_ellipsoid(chain: Chain, q: npt.ArrayLike) -> VelocityEllipsoid:
    """Of the translational Jacobian of the tool point at `q` (n,) [rad]."""
    R = forward(chain, q)[:3, :3]
    axes, radii, _ = np.linalg.svd(R @ jacobian_body(chain, q)[3:])
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return VelocityEllipsoid(frozen(axes), frozen(radii))


def jog(
    chain: Chain,
    q: npt.ArrayLike,
    V: npt.ArrayLike,
    frame: JogFrame,
    dt: float,
    *,
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """(5,) joint rates [rad/s] that move the tool with the twist `V` (6,) [rad/s, m/s].

    Of a rotation the arm can do two components, about the axes of pitch and of roll; the third is
    left to follow from where the tool goes. Damped least squares: the rates stay bounded near a
    singularity, and what is lost there is lost along the lost direction. A joint that would pass
    its limit within `dt` [s] stops there and the others make up for it as they can. If a joint
    would be too fast all are slowed alike, so the direction is kept.

    bounds: the least and the most (n,) [rad/s] that each joint may have besides, around 0; those of
    a joint that has mass and comes up to its limit.

    Raises InputError for a `q` or `V` that cannot be used, or a `dt` that is not above 0.
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise InputError(f"A jog lasts some time above 0 s, not {dt:g} s.")
    q = chain.check_q(q)
    V = finite_array(V, (6,), "The twist")
    J, wanted = _task(chain, q, V, frame)
    # Slowed before the limits are looked at: what the arm is too slow for passes none.
    wanted /= _excess(chain, _damped(J, wanted))
    # A joint beyond its limit may come back, and need not.
    maximum = np.maximum((chain.upper - q) / dt, 0.0)
    minimum = np.minimum((chain.lower - q) / dt, 0.0)
    if bounds is not None:
        minimum, maximum = np.maximum(minimum, bounds[0]), np.minimum(maximum, bounds[1])
    qd = np.zeros(chain.n)
    free = np.ones(chain.n, dtype=np.bool_)
    while free.any():
        qd[free] = _damped(J[:, free], wanted - J[:, ~free] @ qd[~free])
        over = np.where(free, np.maximum(qd - maximum, minimum - qd), -math.inf)
        worst = int(over.argmax())
        if over[worst] <= 0.0:
            break
        qd[worst] = min(max(qd[worst], minimum[worst]), maximum[worst])
        free[worst] = False
    return qd / _excess(chain, qd)


def limited_jog(chain: Chain, q: FloatArray, V: FloatArray, edge: float | None = None) -> float:
    """The fraction of the twist `V` (6,) in {S} that a jog at `q` (n,) [rad] follows, from 0 to 1.

    However fast it is. edge: so far from a limit [rad] a joint does not go towards it; None leaves
    limits aside.
    """
    J, wanted = _task(chain, q, V, JogFrame.BASE)
    size = float(wanted @ wanted)
    if size == 0.0:
        return 1.0
    if edge is None:
        return float(wanted @ (J @ _damped(J, wanted))) / size
    minimum = np.where(q - chain.lower > edge, -chain.speed, 0.0)
    maximum = np.where(chain.upper - q > edge, chain.speed, 0.0)
    slow = SLOW / math.sqrt(size)
    qd = jog(chain, q, slow * V, JogFrame.BASE, SLOW, bounds=(minimum, maximum))
    return float(wanted @ (J @ qd)) / (slow * size)


def tool_speed(chain: Chain, q: FloatArray, qd: FloatArray) -> float:
    """How fast the tool point is [m/s] at `q` (5,) [rad] with the joint rates `qd` (5,) [rad/s].

    On plain floats, for a control tick. Exact for a tool point on the roll axis; one beside it may
    be slower than this says, and never is faster.
    """
    arm = arm_of(chain)
    _, two, three, four, _ = arm.canonical(q).tolist()
    pan, first, second, third, roll = (qd * arm.signs).tolist()
    second += first
    third += second
    three += two
    four += three
    # In the arm's plane: u outward, v down.
    u = arm.a + arm.l1 * math.cos(two) + arm.l2 * math.cos(three) + arm.l3 * math.cos(four)
    du = -first * arm.l1 * math.sin(two) - second * arm.l2 * math.sin(three)
    du -= third * arm.l3 * math.sin(four)
    dv = first * arm.l1 * math.cos(two) + second * arm.l2 * math.cos(three)
    dv += third * arm.l3 * math.cos(four)
    beside = arm.off_axis * (abs(pan) + abs(third) + abs(roll)) if arm.off_axis else 0.0
    return math.hypot(du - pan * arm.d, pan * u, dv) + beside


def tool_speed_bound(chain: Chain, qd: FloatArray) -> float:
    """[m/s] No posture has a greater `tool_speed` with rates of up to `qd` (5,) [rad/s] each."""
    arm = arm_of(chain)
    pan, first, second, third, roll = np.abs(qd).tolist()
    l2, l3 = arm.l2 + arm.l3, arm.l3
    reach: float = abs(arm.a) + arm.l1 + l2
    plane: float = first * (arm.l1 + l2) + second * l2 + third * l3
    beside: float = arm.off_axis * (pan + first + second + third + roll)
    return math.hypot(pan * reach, plane + pan * abs(arm.d)) + beside


def _excess(chain: Chain, qd: FloatArray) -> float:
    """By what factor the rates `qd` (n,) [rad/s] are too fast for the joints; at least 1."""
    return max(1.0, float((np.abs(qd) / chain.speed).max()))


def _task(
    chain: Chain, q: FloatArray, V: FloatArray, frame: JogFrame
) -> tuple[FloatArray, FloatArray]:
    """Jacobian (5, n) and wish (5,) of what the arm can follow: pitch, roll, and v over a length.

    All in the tool frame, at the tool point.
    """
    R = forward(chain, q)[:3, :3]
    omega, v = (V[:3], V[3:]) if frame is JogFrame.TOOL else (R.T @ V[:3], R.T @ V[3:])
    frames = joint_frames(chain, q)
    # Parallel axes stay parallel: axis 2 is the axis of pitch, and of roll the last.
    pitch_axis = R.T @ frames[1][:3, :3] @ chain.S[:3, 1]
    roll_axis = R.T @ frames[-1][:3, :3] @ chain.S[:3, -1]
    length = characteristic_length(chain)
    J = jacobian_body(chain, q)
    task = np.vstack((pitch_axis @ J[:3], roll_axis @ J[:3], J[3:] / length))
    return task, np.array((pitch_axis @ omega, roll_axis @ omega, *(v / length)))


def _damped(J: FloatArray, wanted: FloatArray) -> FloatArray:
    """The rates for `wanted`, each singular direction damped as its singular value vanishes."""
    U, values, Vt = np.linalg.svd(J, full_matrices=False)
    shortfall = np.clip(1.0 - values / WELL_CONDITIONED, 0.0, 1.0)
    square = np.square(STRONGEST_DAMPING * shortfall)
    gain = np.divide(values, values**2 + square)
    return np.asarray(Vt.T @ (gain * (U.T @ wanted)))
